/* A board without operating system or C library: start, and printing.

   For Cortex-M7 (QEMU's mps2-an500) and Cortex-A53 (QEMU's virt). It prints through semihosting: one row per step, the
   64 bits of each double as a hexadecimal word. */

#include <stdint.h>

enum { SYS_WRITE0 = 0x04, SYS_EXIT = 0x18, APPLICATION_EXIT = 0x20026 };

int main(void);
extern char stack_top[];

#ifdef __arm__

static void semihost(uintptr_t operation, const void *argument)
{
    register uintptr_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
}

static void quit(void) { semihost(SYS_EXIT, (const void *)APPLICATION_EXIT); }

void reset(void)
{
    *(volatile uint32_t *)0xE000ED88 |= 0xFu << 20; /* CPACR: the floating point unit is off after reset */
    *(volatile uint32_t *)0xE000ED14 |= 1u << 3;    /* CCR.UNALIGN_TRP: an unaligned access is a fault */
    __asm__ volatile("dsb\n isb");
    main();
}

static void fault(void)
{
    semihost(SYS_WRITE0, "fault\n");
    quit();
}

__attribute__((section(".start"), used)) void *const vectors[] = {
    stack_top, (void *)reset, (void *)fault, (void *)fault, (void *)fault, (void *)fault, (void *)fault,
};

#else

static void semihost(uintptr_t operation, const void *argument)
{
    register uintptr_t x0 __asm__("x0") = operation;
    register const void *x1 __asm__("x1") = argument;
    __asm__ volatile("hlt 0xf000" : "+r"(x0) : "r"(x1) : "memory");
}

static void quit(void)
{
    static const uint64_t reason[] = {APPLICATION_EXIT, 0};
    semihost(SYS_EXIT, reason);
}

/* stack; CPACR_EL1.FPEN: floating point; SCTLR_EL1.A: an unaligned access is a fault, and there is no handler */
__asm__(".section .start, \"ax\"\n"
        ".global reset\n"
        "reset: ldr x0, =stack_top\n mov sp, x0\n"
        "mrs x0, cpacr_el1\n orr x0, x0, #(3 << 20)\n msr cpacr_el1, x0\n"
        "mrs x0, sctlr_el1\n orr x0, x0, #2\n msr sctlr_el1, x0\n isb\n"
        "bl main\n b .\n");

#endif

/* A double as a hexadecimal word with a character behind it. */
static void print(double value, char behind)
{
    union {
        double number;
        uint64_t word;
    } bits = {value};
    char text[18];
    for (int i = 0; i < 16; i++) text[i] = "0123456789abcdef"[bits.word >> (60 - 4 * i) & 15];
    text[16] = behind;
    text[17] = 0;
    semihost(SYS_WRITE0, text);
}
