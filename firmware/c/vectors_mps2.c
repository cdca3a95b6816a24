/* Where an emulated Cortex-M4F begins: its stack at the end of the MPS2 board's first 4 MB, then newlib. */
#include <stdint.h>

extern void _start(void);

typedef void (*handler)(void);

static void stopped(void)
{
    for (;;) {
    }
}

static void reset(void)
{
    /* Coprocessor access control: the floating-point unit on, because newlib was built for it. */
    *(volatile uint32_t *)0xE000ED88U |= 0xFU << 20;
    __asm volatile("dsb\n isb");
    _start();
}

__attribute__((section(".vectors"), used)) static const handler first[16] = {
    (handler)0x00400000, reset, stopped, stopped, stopped, stopped, stopped,
};
