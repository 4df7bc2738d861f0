import { Chart } from "/web/chart.js";
import { decode } from "/web/scale.js";

// Vue observes all nested elements: the chart gets a copy that it may modify
const copy = (panes) => JSON.parse(JSON.stringify(panes));

export default {
  template: "<div></div>",
  props: { panes: Array, url: String, span: Number, follow: Boolean, marks: Array },
  mounted() {
    const source = async ({ names, ...wanted }) => {
      const query = new URLSearchParams(wanted);
      names.forEach((name) => query.append("name", name));
      const answer = await fetch(`${this.url}?${query}`);
      return answer.status === 200 ? decode(await answer.arrayBuffer()) : null;
    };
    const notify = (event, detail) => { if (event !== "drawn") this.$emit(event, detail); };
    this.chart = new Chart(this.$el, { panes: copy(this.panes), span: this.span, follow: this.follow, marks: this.marks, source, notify });
    this.$el.chart = this.chart;  // for tests, and for the console of the browser
  },
  unmounted() { this.chart.close(); },
  watch: {
    panes: { deep: true, handler(panes) { this.chart.setPanes(copy(panes)); } },
    marks: { deep: true, handler() { this.chart.setMarks(this.marks); } },
  },
  methods: {
    show(from, to) { this.chart.setWindow(from, to); },
    followed(span) { this.chart.setFollow(span); },
    cursors(list) { this.chart.setCursors(list); },
  },
};
