/* The file that a checking program on an AVR reads, HELD_FILE, behind the program. */
    .section .progmemx.file, "a", @progbits
    .global file_from
    .global file_to
file_from:
    .incbin HELD_FILE
file_to:
    .byte 0
