"""Statements as C: declarations as late as Python's meaning allows, branches, loops, assignments."""

from tests.compiler.c_text import c_of
from tests.every_case import every_case

STATEMENTS = """
w = self.x * 2.0
self.y = w
=>
const double w = self->x * 2.0;
self->y = w;

w = 1
w = self.x
self.y = w
=>
double w = 1.0;
w = self->x;
self->y = w;

w = self.x
if w > 1.0:
    w = 1.0
self.y = w
=>
double w = self->x;
if (w > 1.0) {
    w = 1.0;
}
self->y = w;

if self.on:
    w = 1.0
else:
    w = 2.0
self.y = w
=>
double w = 0.0;
if (self->on) {
    w = 1.0;
} else {
    w = 2.0;
}
self->y = w;

if self.on:
    w = 1
elif self.off:
    w = self.x
else:
    w = False
self.y = w
=>
double w = 0.0;
if (self->on) {
    w = 1.0;
} else if (self->off) {
    w = self->x;
} else {
    w = (double)false;
}
self->y = w;

if self.on:
    self.x = 1.0
elif self.off:
    self.x = 2.0
elif act(self) > 3:
    self.x = 3.0
else:
    self.x = 4.0
=>
if (self->on) {
    self->x = 1.0;
} else if (self->off) {
    self->x = 2.0;
} else if (act(self) > 3) {
    self->x = 3.0;
} else {
    self->x = 4.0;
}

for i in range(4):
    self.v[i] = i
=>
for (int64_t i = 0; i < 4; i++) {
    self->v[i] = (double)i;
}

for i in range(1, self.n):
    self.x += self.v[i]
=>
const int64_t part_1 = self->n;
for (int64_t i = 1; i < part_1; i++) {
    self->x += self->v[i];
}

for i in range(self.n, 0, -1):
    self.v[i] = self.v[i - 1]
=>
for (int64_t i = self->n; i > 0; i--) {
    self->v[from_end(i, 4)] = self->v[from_end(i - 1, 4)];
}

for i in range(3, -1, -1):
    self.v[i] = 0.0
=>
for (int64_t i = 3; i >= 0; i--) {
    self->v[i] = 0.0;
}

for i in range(3, -2, -1):
    self.v[i] = 0.0
=>
for (int64_t i = 3; i > -2; i--) {
    self->v[from_end(i, 4)] = 0.0;
}

for i in range(0, 10, 3):
    self.x += i
=>
for (int64_t i = 0; i < 10; i += 3) {
    self->x += (double)i;
}

for i in range(9, self.b, -2):
    self.x += i
=>
const int64_t part_1 = self->b;
for (int64_t i = 9; i > part_1; i += -2) {
    self->x += (double)i;
}

for i in range(self.n):
    self.n -= 1
    self.x = i
=>
const int64_t part_1 = self->n;
for (int64_t i = 0; i < part_1; i++) {
    self->n -= 1;
    self->x = (double)i;
}

for i in range(3):
    for j in range(2):
        self.m[i, j] = i * 10 + j
=>
for (int64_t i = 0; i < 3; i++) {
    for (int64_t j = 0; j < 2; j++) {
        self->m[i][j] = (double)(i * 10 + j);
    }
}

for i in range(5):
    if i == self.a:
        continue
    if i > self.b:
        break
    self.x += 1
=>
for (int64_t i = 0; i < 5; i++) {
    if (i == self->a) {
        continue;
    }
    if (i > self->b) {
        break;
    }
    self->x += 1.0;
}

for _ in range(3):
    self.x *= 2.0
=>
for (int64_t part_1 = 0; part_1 < 3; part_1++) {
    self->x *= 2.0;
}

last = -1
for last in range(self.n):
    pass
self.a = last
=>
int64_t last = -1;
const int64_t part_2 = self->n;
for (int64_t part_1 = 0; part_1 < part_2; part_1++) {
    last = part_1;
}
self->a = last;

for value in TABLE:
    self.x += value
=>
for (int64_t part_1 = 0; part_1 < 3; part_1++) {
    const double value = TABLE[part_1];
    self->x += value;
}

for a, b, c in ROWS:
    self.a += a * b - c
=>
for (int64_t part_1 = 0; part_1 < 2; part_1++) {
    const int64_t a = ROWS[part_1][0];
    const int64_t b = ROWS[part_1][1];
    const int64_t c = ROWS[part_1][2];
    self->a += a * b - c;
}

for value in self.v:
    self.x += value
=>
for (int64_t part_1 = 0; part_1 < 4; part_1++) {
    const double value = self->v[part_1];
    self->x += value;
}

while self.x > 0.0:
    self.x -= 1.0
=>
while (self->x > 0.0) {
    self->x -= 1.0;
}

while act(self) < 5:
    self.x += 1.0
=>
while (act(self) < 5) {
    self->x += 1.0;
}

while True:
    self.x += 1.0
    if self.x > 3.0:
        break
=>
while (true) {
    self->x += 1.0;
    if (self->x > 3.0) {
        break;
    }
}

self.x += 1
self.x -= self.a
self.x *= self.y + 1.0
self.x /= 2
self.x %= 3.0
self.x **= 2
self.a += self.c
self.a //= 2
self.a <<= 1
self.a |= 4
self.c += 1
self.v[self.a] += 1.0
self.m[0, 1] -= 2.0
=>
self->x += 1.0;
self->x -= (double)self->a;
self->x *= self->y + 1.0;
self->x /= 2.0;
self->x = real_mod(self->x, 3.0);
self->x = power(self->x, 2.0);
self->a += self->c;
self->a = int_floor_div(self->a, 2);
self->a = shift_left(self->a, 1);
self->a |= 4;
self->c = (int32_t)((int64_t)self->c + 1);
self->v[from_end(self->a, 4)] += 1.0;
self->m[0][1] -= 2.0;

unused = self.x
=>
const double unused = self->x;
(void)unused;

if FEW > 2:
    self.x = 1.0
else:
    self.x = 2.0
=>
if (FEW > 2) {
    self->x = 1.0;
} else {
    self->x = 2.0;
}

if FEW is None:
    self.x = 1.0
else:
    self.x = 2.0
=>
self->x = 2.0;

while self.a > 0:
    if self.on:
        w = self.x
    else:
        w = self.y
    self.z += w
    self.a -= 1
=>
while (self->a > 0) {
    double w = 0.0;
    if (self->on) {
        w = self->x;
    } else {
        w = self->y;
    }
    self->z += w;
    self->a -= 1;
}

total = 0
for i in range(3):
    total += i
    if total > 1:
        found = total
        self.x = found
self.a = total
=>
int64_t total = 0;
for (int64_t i = 0; i < 3; i++) {
    total += i;
    if (total > 1) {
        const int64_t found = total;
        self->x = (double)found;
    }
}
self->a = total;

for i in range(2):
    if i == 0:
        w = self.x
    self.y = w
=>
double w = 0.0;
for (int64_t i = 0; i < 2; i++) {
    if (i == 0) {
        w = self->x;
    }
    self->y = w;
}

a = self.b % 4
b = a + 1
self.x = self.v[a] + self.v[b - 1]
=>
const int64_t a = int_mod(self->b, 4);
const int64_t b = a + 1;
self->x = self->v[a] + self->v[from_end(b - 1, 4)];

a = 3
while a > 0:
    a -= 1
    self.x = self.v[a]
=>
int64_t a = 3;
while (a > 0) {
    a -= 1;
    self->x = self->v[from_end(a, 4)];
}

a = 0
for i in range(3):
    a += i
    self.x = self.v[a]
=>
int64_t a = 0;
for (int64_t i = 0; i < 3; i++) {
    a += i;
    self->x = self->v[a];
}

pass
=>
(void)self;

# twice the position
# of the tip
w = self.x * 2.0  # in its own frame
if w > 1.0:  # far
    # noqa
    self.y = w
# done
self.z = w
=>
/* twice the position of the tip in its own frame */
const double w = self->x * 2.0;
/* far */
if (w > 1.0) {
    self->y = w;
}
/* done */
self->z = w;
"""


@every_case("case", STATEMENTS.strip().split("\n\n"))
def test_statements(case):
    python, expected = case.split("\n=>\n")
    assert c_of(python) == expected
