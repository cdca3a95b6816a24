// The parameters of one gyro axis: a memory for the image's bytes, and the loader that checks them.
//
//     write -> spare half -> load: CRC, fields, unit -> head -> halves change places -> restart of the correction
//
// An image (docs/reference/image-format.md) is written as it is, four bytes a word, the first byte in the lowest bits, and `load`
// begins the check. An image that is refused changes nothing: the one in force stays in force. `fault` says why and `fault_word` where:
//
//     1 not an image   2 version   3 length   4 CRC   5 a field's value   6 more than this hardware was built with   7 another unit
//
// Checked are magic, version, length, CRC-32, every count, index, source, kind, multiplier, shape, order and shift, the reserved
// bytes, the head's ranges, and serial, axis and tick next to the unit's own. Not checked are the sizes of gains, spans and
// mantissas, which need products: whoever makes an image or sends one checks these (sagnac_identity, sagnac_compensator_load).
//
// A check takes 33 clocks a word and 2 more for its fields: 7,000 clocks for the longest image. `restart` is high for the last 35 of
// them if an image was in force before. After `rst` no image is in force; with IMAGE, a file for $readmemh, the check of that one
// begins by itself.
//
// Where it fails: a bit that turns over in the memory after the check is not seen until the next `load` of the same image.
`timescale 1ns / 1ns
`default_nettype none

module sagnac_image #(
    parameter INPUTS = 4,           // most inputs, 1 to 4
    parameter PIECES = 1,           // zones and steps
    parameter HARMONICS = 1,
    parameter DERIVED = 1,          // differences, repeats, warm-ups
    parameter STEP_LIMITS = 1,      // largest steps of a thermometer
    parameter IMAGE = ""            // file of words that the memory begins with
) (
    input  wire         clk,
    input  wire         rst,
    input  wire         write,           // refused while `checking`
    input  wire [7:0]   write_address,
    input  wire [31:0]  write_data,
    input  wire         load,            // ignored while `checking`
    input  wire         check_unit,      // refuse the image of another unit
    input  wire [255:0] unit_serial,     // the first character in the lowest bits, zeros behind the last
    input  wire [7:0]   unit_axis,
    input  wire [31:0]  unit_tick_ns,
    output reg          loaded,
    output wire         checking,
    output wire         restart,
    output reg          write_refused,   // since the last `load`
    output reg  [2:0]   fault,
    output reg  [7:0]   fault_word,
    output reg  [31:0]  image_crc,
    output reg  [31:0]  period_ticks,
    output reg  [31:0]  slew_ticks,
    output reg  [31:0]  output_limit,
    output reg  [2:0]   inputs,
    output reg  [5:0]   terms,
    output reg  [3:0]   highest_order,
    input  wire [7:0]   address,
    output wire [31:0]  word             // of `address`, a clock later
);
    localparam [2:0] NOT_AN_IMAGE = 3'd1, VERSION = 3'd2, LENGTH = 3'd3, CRC = 3'd4, FIELD = 3'd5, HARDWARE = 3'd6, UNIT = 3'd7;
    localparam [2:0] IDLE = 3'd0, READ = 3'd1, LOOK = 3'd2, SUM_BITS = 3'd3, DONE = 3'd4, BEGIN = 3'd5;
    localparam [1:0] SUM = 2'd0, FIELDS = 2'd1, HEAD = 2'd2;
    localparam [7:0] FIRST_INPUT = 8'd32;
    /* verilator lint_off WIDTH */ // a parameter is an integer, in range
    localparam [2:0] MOST_INPUTS = INPUTS;
    /* verilator lint_on WIDTH */
    // An empty name leaves the memory without a beginning.
    localparam HAS_IMAGE = IMAGE != "";

    reg [31:0] half_0 [0:255];
    reg [31:0] half_1 [0:255];
    reg [31:0] word_0, word_1;
    reg active;
    reg [7:0] at;
    wire [7:0] address_0 = active ? at : address;
    wire [7:0] address_1 = active ? address : at;
    wire [31:0] here = active ? word_0 : word_1;
    assign word = active ? word_1 : word_0;

    generate
        if (HAS_IMAGE) begin : preset
            initial $readmemh(IMAGE, half_0);
        end
    endgenerate

    always @(posedge clk) begin
        if (write && !checking && active)
            half_0[write_address] <= write_data;
        word_0 <= half_0[address_0];
    end
    always @(posedge clk) begin
        if (write && !checking && !active)
            half_1[write_address] <= write_data;
        word_1 <= half_1[address_1];
    end

    reg [2:0] state;
    reg [1:0] pass;
    reg [7:0] last;
    reg [31:0] crc, bits;
    reg [4:0] bit_count;
    reg nonzero;
    reg [2:0] input_count;
    // The place in an input or a term, and which it is.
    reg in_terms;
    reg [3:0] place;
    reg [5:0] entry;
    reg [3:0] order_so_far;

    assign checking = state != IDLE;
    assign restart = loaded && pass == HEAD && checking;

    wire in_head = at < FIRST_INPUT;
    wire [8:0] wanted_last = 9'd32 + {2'd0, here[10:8], 4'd0} + {3'd0, here[21:16]} + {2'd0, here[21:16], 1'b0};
    wire entry_ends = in_terms ? place == 4'd2 : place == 4'd15;

    // The serial is words 4 to 11.
    wire [2:0] serial_word = {!at[2], at[1:0]};
    wire [31:0] unit_word = unit_serial[32*serial_word +: 32];

    // What is wrong with a word of the first pass, and of the second.
    // SAG-CORE-018
    reg [2:0] sum_fault, field_fault;
    always @* begin
        sum_fault = 3'd0;
        case (at)
            8'd0: if (here != 32'h4e474153) sum_fault = NOT_AN_IMAGE;
            8'd1: if (here != 32'h4d494341) sum_fault = NOT_AN_IMAGE;
            8'd2: if (here[15:0] != 16'd1 || here[31:16] > 16'd5) sum_fault = VERSION;
            8'd3: if (here > 32'd772 || here < 32'd132 || here[1:0] != 2'd0) sum_fault = LENGTH;
            default: if (at == last && here != ~crc) sum_fault = CRC;
        endcase
    end

    wire [7:0] byte_0 = here[7:0], byte_1 = here[15:8], byte_2 = here[23:16], byte_3 = here[31:24];
    wire [7:0] own_entry = {2'd0, entry};
    wire source_is_legal = byte_1 == 8'd0 ? {byte_2, byte_3} == 16'd0
        : (byte_1 == 8'd1 ? byte_2 < own_entry && byte_3 < own_entry
        : (byte_1 == 8'd2 ? byte_2 < own_entry && byte_3 == 8'd0 : byte_1 == 8'd3 && {byte_2, byte_3} == 16'd0));
    wire shape_is_legal = byte_1 <= 8'd4 && byte_0 >= 8'd8 && byte_0 <= 8'd62
        && (byte_1 != 8'd0 || here[31:16] == 16'd0) && (byte_1 >= 8'd3 || byte_1 == 8'd0 || !nonzero);
    always @* begin
        field_fault = 3'd0;
        if (in_head)
            case (at)
                8'd4, 8'd5, 8'd6, 8'd7, 8'd8, 8'd9, 8'd10, 8'd11: if (check_unit && here != unit_word) field_fault = UNIT;
                8'd12: if (byte_1 > 8'd4 || byte_2 > 8'd32 || byte_3 != 8'd0 || {1'b0, last} != wanted_last) field_fault = FIELD;
                    else if (byte_1 > {5'd0, MOST_INPUTS}) field_fault = HARDWARE;
                    else if (check_unit && byte_0 != unit_axis) field_fault = UNIT;
                8'd13: if (here == 32'd0) field_fault = FIELD;
                    else if (check_unit && here != unit_tick_ns) field_fault = UNIT;
                8'd14: if (here == 32'd0 || here > 32'd16777216) field_fault = FIELD;
                8'd15: if (here > bits) field_fault = FIELD;
                8'd17, 8'd19: if (here == 32'd0 && !nonzero) field_fault = FIELD;
                8'd22: if (here == 32'd0 || here[31]) field_fault = FIELD;
                8'd31: if (here != 32'd0) field_fault = FIELD;
                default: field_fault = 3'd0;
            endcase
        else if (!in_terms)
            case (place)
                4'd1: if (here == 32'd0) field_fault = FIELD;
                4'd2: if (byte_0 > 8'd62 || byte_1 > 8'd15 || byte_2 > 8'd62 || (byte_2 != 8'd0 && byte_2 < 8'd31)
                    || (byte_3 >= byte_2 && byte_3 != 8'd0)) field_fault = FIELD;
                4'd3: if (byte_0 > 8'd31 || !source_is_legal) field_fault = FIELD;
                    else if (DERIVED == 0 && byte_1 != 8'd0) field_fault = HARDWARE;
                4'd9: if (here > 32'h80000000 || (here != 32'd0) != nonzero) field_fault = FIELD;
                4'd15: if (byte_3 > 8'd16 || (byte_3 != 8'd0 && {byte_1, byte_2} == 16'd0)) field_fault = FIELD;
                    else if (STEP_LIMITS == 0 && {byte_1, byte_2} != 16'd0) field_fault = HARDWARE;
                default: field_fault = 3'd0;
            endcase
        else
            case (place)
                4'd0: if (byte_0 == 8'd0 || byte_0 > 8'd2 || byte_1 >= {5'd0, input_count} || byte_3 > 8'd1) field_fault = FIELD;
                4'd1: if (here == 32'h80000000) field_fault = FIELD;
                4'd2: if (!shape_is_legal || (byte_1 == 8'd0 && bits > 32'd8)) field_fault = FIELD;
                    else if ((PIECES == 0 && (byte_1 == 8'd1 || byte_1 == 8'd2)) || (HARMONICS == 0 && byte_1 >= 8'd3)) field_fault = HARDWARE;
                default: field_fault = 3'd0;
            endcase
    end

    wire [2:0] found = pass == SUM ? sum_fault : (pass == FIELDS && at != last ? field_fault : 3'd0);

    always @(posedge clk) begin
        if (write && checking)
            write_refused <= 1'b1;
        if (rst) begin
            state <= HAS_IMAGE ? BEGIN : IDLE;
            pass <= SUM;
            active <= 1'b1;
            loaded <= 1'b0;
            write_refused <= 1'b0;
            fault <= 3'd0;
            fault_word <= 8'd0;
            at <= 8'd0;
            inputs <= 3'd0;
            terms <= 6'd0;
            highest_order <= 4'd0;
            period_ticks <= 32'd0;
            slew_ticks <= 32'd0;
            output_limit <= 32'd0;
            image_crc <= 32'd0;
        end else
            case (state)
                IDLE: if (load) begin
                    write_refused <= write;
                    state <= BEGIN;
                end
                BEGIN: begin
                    fault <= 3'd0;
                    fault_word <= 8'd0;
                    pass <= SUM;
                    at <= 8'd0;
                    last <= 8'd255;
                    crc <= 32'hffffffff;
                    state <= READ;
                end
                READ: state <= LOOK;
                LOOK: begin
                    bits <= here;
                    bit_count <= 5'd31;
                    nonzero <= here != 32'd0;
                    if (found != 3'd0) begin
                        fault <= found;
                        fault_word <= at;
                        state <= IDLE;
                    end else if (at == last) begin
                        at <= pass == SUM ? 8'd0 : 8'd12;
                        pass <= pass == SUM ? FIELDS : HEAD;
                        state <= READ;
                    end else begin
                        at <= at + 8'd1;
                        state <= pass == SUM ? SUM_BITS : (pass == HEAD && at == 8'd22 ? DONE : READ);
                    end
                    if (pass == SUM && at == 8'd3)
                        last <= here[9:2] - 8'd1;
                    if (pass == FIELDS) begin
                        if (in_head) begin
                            in_terms <= input_count == 3'd0;
                            place <= 4'd0;
                            entry <= 6'd0;
                            order_so_far <= 4'd0;
                            if (at == 8'd12)
                                input_count <= here[10:8];
                        end else begin
                            place <= entry_ends ? 4'd0 : place + 4'd1;
                            if (entry_ends) begin
                                entry <= entry + 6'd1;
                                if (!in_terms && entry + 6'd1 == {3'd0, input_count}) begin
                                    in_terms <= 1'b1;
                                    entry <= 6'd0;
                                end
                            end
                            // An order is a whole byte, and zero for a zone or a step; a lag is used when its shift is not zero.
                            if (in_terms && place == 4'd0) begin
                                bits <= {24'd0, byte_2};
                            end else if (in_terms) begin
                                bits <= bits;
                                nonzero <= bits[7:0] != 8'd0;
                                if (place == 4'd2 && byte_1 == 8'd0 && bits[3:0] > order_so_far)
                                    order_so_far <= bits[3:0];
                            end else
                                nonzero <= place == 4'd2 ? byte_2 != 8'd0 : nonzero;
                        end
                    end
                    if (pass == HEAD)
                        case (at)
                            8'd12: begin
                                highest_order <= order_so_far;
                                inputs <= here[10:8];
                                terms <= here[21:16];
                                image_crc <= ~crc;
                            end
                            8'd14: period_ticks <= here;
                            8'd15: slew_ticks <= here;
                            8'd22: output_limit <= here;
                            default: begin end
                        endcase
                end
                // The checksum, a bit a clock, the lowest first.
                SUM_BITS: begin
                    crc <= {1'b0, crc[31:1]} ^ (crc[0] != bits[0] ? 32'hedb88320 : 32'd0);
                    bits <= {1'b0, bits[31:1]};
                    bit_count <= bit_count - 5'd1;
                    if (bit_count == 5'd0)
                        state <= LOOK;
                end
                DONE: begin
                    active <= !active;
                    pass <= SUM;
                    loaded <= 1'b1;
                    state <= IDLE;
                end
                default: state <= IDLE;
            endcase
    end
endmodule

`default_nettype wire
