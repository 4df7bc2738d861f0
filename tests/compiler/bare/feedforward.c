/* A firmware that asks the feedforward controller for coordinates all over the workspace, and prints the step counts. */

#include "board.h"
#include "coordinate_feedforward.h"

int main(void)
{
    static coordinate_feedforward_t part;
    coordinate_feedforward_init(&part);
    coordinate_feedforward_start(&part, 0.0);
    for (int k = 0; k < 60; k++) {
        part.target_y = 0.0016 * (k * 7 % 11);
        part.target_z = 0.0015 * (k * 5 % 13);
        part.target_needle_length = 0.0004 * (k % 8);
        if (coordinate_feedforward_step(&part, 0.01 * k, 0.01) > TWIN_WARNING) break;
        print(part.handle_steps, ' ');
        print(part.wire_steps, ' ');
        print(part.needle_steps, ' ');
        print(part.refusal, '\n');
    }
    quit();
    return 0;
}
