"""Contrast of text against its background as a browser shows it: WCAG 2.2, criterion 1.4.3, level AA."""

FAILURES = """() => {
  const canvas = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  const rgba = (color) => { canvas.clearRect(0, 0, 1, 1); canvas.fillStyle = color; canvas.fillRect(0, 0, 1, 1);
    const [r, g, b, a] = canvas.getImageData(0, 0, 1, 1).data; return [r, g, b, a / 255]; };
  const over = (top, under) => [0, 1, 2].map((i) => top[3] * top[i] + (1 - top[3]) * under[i]);
  const light = (color) => color.slice(0, 3).map((c) => c / 255).map((c) => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)
    .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
  const parents = (element) => element ? [element, ...parents(element.parentElement)] : [];
  const background = (element) => parents(element).reverse().filter((each) => !(each instanceof SVGElement && each.tagName !== "svg"))
    .reduce((under, each) => over(rgba(getComputedStyle(each).backgroundColor), under), [255, 255, 255]);
  const fills = (text) => { // of the shape behind a text of a drawing
    const box = text.getBoundingClientRect(), x = box.left + box.width / 2, y = box.top + box.height / 2;
    return [...text.ownerSVGElement.querySelectorAll("rect, circle, ellipse, path, polygon")].filter((shape) => {
      const { left, right, top, bottom } = shape.getBoundingClientRect();
      return left <= x && x <= right && top <= y && y <= bottom && text.compareDocumentPosition(shape) & Node.DOCUMENT_POSITION_PRECEDING
        && shape.isPointInFill(new DOMPoint(x, y).matrixTransform(shape.getScreenCTM().inverse()));
    }).map((shape) => getComputedStyle(shape)).filter(({ fill }) => fill !== "none" && !fill.startsWith("url"))
      .map(({ fill, fillOpacity, opacity }) => [...rgba(fill).slice(0, 3), rgba(fill)[3] * fillOpacity * opacity]);
  };
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), failures = {};
  const check = (element, color, text) => {
    const style = getComputedStyle(element), box = element.getBoundingClientRect();
    if (!box.width || !element.checkVisibility({ opacityProperty: true, visibilityProperty: true }) || element.closest(":disabled, .disabled, [aria-hidden=true]")) return;
    const drawing = element.ownerSVGElement, inverted = drawing ? Number(/invert\\(([\\d.]+)/.exec(getComputedStyle(drawing).filter)?.[1] ?? 0) : 0;
    const filtered = ([r, g, b, a]) => [...[r, g, b].map((c) => inverted * (255 - c) + (1 - inverted) * c), a]; // of grays, whose hue does not turn
    const under = (drawing ? fills(element).map(filtered) : []).reduce((below, fill) => over(fill, below), background(element)), own = filtered(rgba(color)), opacity = parents(element).reduce((all, each) => all * getComputedStyle(each).opacity, 1);
    const [a, b] = [light(over([...own.slice(0, 3), own[3] * opacity], under)), light(under)].sort((x, y) => y - x);
    const size = parseFloat(style.fontSize), isLarge = size >= 24 || (size >= 18.66 && style.fontWeight >= 700);
    const ratio = (a + 0.05) / (b + 0.05);
    if (ratio < (isLarge ? 3 : 4.5)) failures[`${element.tagName.toLowerCase()}.${element.getAttribute("class") ?? ""}: ${color} on rgb(${under.map(Math.round)}) ${ratio.toFixed(2)}`] ??= text.trim().slice(0, 40);
  };
  let checked = 0;
  while (texts.nextNode()) {
    const element = texts.currentNode.parentElement;
    if (!texts.currentNode.textContent.trim() || element.closest("script, style, noscript")) continue;
    check(element, element instanceof SVGElement ? getComputedStyle(element).fill : getComputedStyle(element).color, texts.currentNode.textContent);
    checked += 1;
  }
  for (const field of document.querySelectorAll("input:not([type=checkbox], [type=radio], [type=range]), textarea")) {
    if (field.value) check(field, getComputedStyle(field).color, field.value);
    else if (field.placeholder) check(field, getComputedStyle(field, "::placeholder").color, field.placeholder);
  }
  return [checked, failures];
}"""


def contrast_failures(page):
    """Texts of a page below 4.5:1, or 3:1 for large letters, by element and colors; the page must have texts."""
    checked, failures = page.evaluate(FAILURES)
    assert checked > 10
    return failures
