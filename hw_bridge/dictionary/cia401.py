"""Objects of CiA 401, the device profile of I/O modules, as far as digital inputs and outputs go."""

DIGITAL_INPUTS, DIGITAL_OUTPUTS = 1 << 16, 1 << 17  # of 1000h
BYTES = 4  # of outputs, and of inputs
BLOCKS = range(1, BYTES + 1)
OUTPUTS, ERROR_MODE, ERROR_VALUE, INPUTS = 0x6200, 0x6206, 0x6207, 0x6000
