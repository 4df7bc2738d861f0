/* A firmware that runs two components, each with the other's value of the last step, and prints what they give. */

#include "board.h"
#include "servomotor.h"
#include "sheath.h"

int main(void)
{
    static sheath_t sheath;
    static servomotor_t motor;
    sheath_init(&sheath);
    servomotor_init(&motor);
    sheath_start(&sheath, 0.0);
    servomotor_start(&motor, 0.0);
    for (int k = 0; k < 400; k++) {
        double t = k / 1000.0;
        motor.target_velocity = k % 200 < 100 ? 0.1 : -0.1;
        motor.load_force = sheath.reaction_force;
        sheath.gripper_position = motor.position;
        if (sheath_step(&sheath, t, 0.001) != TWIN_OK || servomotor_step(&motor, t, 0.001) != TWIN_OK) break;
        print(sheath.tip_position, ' ');
        print(motor.position, ' ');
        print(motor.current, '\n');
    }
    quit();
    return 0;
}
