/*
 * Where a checking program begins on an 8-bit AVR, whose int has 16 bits: no file system and no arguments, so the file is in flash
 * (avr_file.S) and what is printed goes to the serial port.
 *
 * The program is compiled with -Dmain=check_main. The processor sleeps for good at the end, which ends the emulator.
 */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/pgmspace.h>
#include <avr/sleep.h>
#include <stdint.h>
#include <stdio.h>

int check_main(int argc, char **argv);

extern const unsigned char file_from[] PROGMEM;
extern const unsigned char file_to[] PROGMEM;

static uint_farptr_t at;

static int next(FILE *stream)
{
    (void)stream;
    if (at >= pgm_get_far_address(file_to)) {
        return _FDEV_EOF;
    }
    return pgm_read_byte_far(at++);
}

static int put(char c, FILE *stream)
{
    (void)stream;
    while ((UCSR0A & _BV(UDRE0)) == 0) {
    }
    UDR0 = (uint8_t)c;
    return 0;
}

static FILE from_flash = FDEV_SETUP_STREAM(NULL, next, _FDEV_SETUP_READ);
static FILE to_line = FDEV_SETUP_STREAM(put, NULL, _FDEV_SETUP_WRITE);

FILE *fopen(const char *name, const char *mode)
{
    (void)name;
    (void)mode;
    at = pgm_get_far_address(file_from);
    return &from_flash;
}

#undef main
int main(void)
{
    static char program[] = "check", name[] = "file";
    char *argv[] = {program, name, NULL};
    UCSR0B = _BV(TXEN0);
    stdout = &to_line;
    printf("END %d\n", check_main(2, argv));
    cli();
    sleep_mode();
    return 0;
}
