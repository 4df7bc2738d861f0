"""Several values, arrays and calls with effects as C: everything happens in Python's order."""

from tests.compiler.c_text import c_of
from tests.every_case import every_case

STATEMENTS = """
self.x, self.y = self.y, self.x
=>
const double part_1 = self->y;
const double part_2 = self->x;
self->x = part_1;
self->y = part_2;

a, b = both(self.x, self.a)
self.y = a - b
=>
const tuple_id_t part_1 = both(self->x, self->a);
const int64_t a = part_1.v0;
const double b = part_1.v1;
self->y = (double)a - b;

pair = both(self.x, self.a)
self.y = pair[0] + pair[1]
self.z = pair[self.b]
=>
const tuple_id_t pair = both(self->x, self->a);
self->y = (double)pair.v0 + pair.v1;
self->z = from_end(self->b, 2) == 0 ? (double)pair.v0 : pair.v1;

a, b = 1.0, self.x
a, b = b, a
self.y = a - b
=>
double a = 1.0;
double b = self->x;
const double part_1 = b;
const double part_2 = a;
a = part_1;
b = part_2;
self->y = a - b;

a = b = self.x + 1.0
self.y = a * b
=>
double a = 0.0;
double b = 0.0;
const double part_1 = self->x + 1.0;
a = part_1;
b = part_1;
self->y = a * b;

self.x = self.n + act(self)
=>
const int64_t part_1 = self->n;
const int64_t part_2 = act(self);
self->x = (double)(part_1 + part_2);

self.x = self.y + store_again(self.a)
=>
const double part_1 = self->y;
const int64_t part_2 = self->a;
const double part_3 = store_again(part_2);
self->x = part_1 + part_3;

self.x = act(self) - act(self) * 10
=>
const int64_t part_1 = act(self);
const int64_t part_2 = act(self);
self->x = (double)(part_1 - part_2 * 10);

self.on = self.on and act(self) > 1
=>
const bool part_2 = self->on;
bool part_1 = part_2;
if (part_1) {
    const int64_t part_3 = act(self);
    part_1 = part_3 > 1;
}
self->on = part_1;

self.on = self.x > 0.0 or act(self) > 1 or act(self) > 2
=>
const double part_2 = self->x;
bool part_1 = part_2 > 0.0;
if (!part_1) {
    const int64_t part_3 = act(self);
    part_1 = part_3 > 1;
}
if (!part_1) {
    const int64_t part_4 = act(self);
    part_1 = part_4 > 2;
}
self->on = part_1;

self.x = act(self) if self.on else 0.5
=>
double part_1;
const bool part_2 = self->on;
if (part_2) {
    const int64_t part_3 = act(self);
    part_1 = (double)part_3;
} else {
    part_1 = 0.5;
}
self->x = part_1;

self.x = (self.y or act(self)) + self.n
=>
const double part_2 = self->y;
double part_1 = part_2;
if (part_1 == 0.0) {
    const int64_t part_3 = act(self);
    part_1 = (double)part_3;
}
const int64_t part_4 = self->n;
self->x = part_1 + (double)part_4;

self.v[act(self)] = self.x
=>
const double part_1 = self->x;
const int64_t part_2 = act(self);
self->v[from_end(part_2, 4)] = part_1;

act(self)
=>
(void)act(self);

scaled(self.x)
=>
(void)scaled(self->x, 2.0);

if self.x > 0.0:
    return
self.x = 1.0
=>
if (self->x > 0.0) {
    return;
}
self->x = 1.0;

row = self.m[1]
row[0] = 2.0
self.x = row[1]
=>
double *const row = self->m[1];
row[0] = 2.0;
self->x = row[1];

values = self.v
self.x = values[2]
=>
double *const values = self->v;
self->x = values[2];

w: float = self.x
self.y = w
=>
const double w = self->x;
self->y = w;
"""


@every_case("case", STATEMENTS.strip().split("\n\n"))
def test_order(case):
    python, expected = case.split("\n=>\n")
    assert c_of(python) == expected
