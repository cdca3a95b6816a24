// The whole correction behind a plain bus: image, slow path, fast path and the registers of both. One bitstream for every gyro.
//
//     bus -> image, codes, control          tick, raw -> counts -> valid, corrected, status
//
// The bus: `write` with address and data is done in that clock; `read_data` is the register of `address` in the clock before.
// Word addresses (docs/explanation/fpga.md has the table and the order of a power-on):
//
//     0x000 identification   0x001 control   0x002 state     0x003 ticks to the update   0x004 ticks refused   0x005 CRC in force
//     0x006 axis             0x007 tick, ns  0x008 to 0x00f serial
//     0x010 to 0x013 codes   0x014 present, begins an update    0x016 hardware    0x017 word of the fault
//     0x018 to 0x01f remainder, increment, target, k, the lower word first
//     0x020 ticks of an increment   0x021 interrupts   0x022 increments that wait   0x023 to 0x025 the oldest: tick, counts, status
//     0x100 to 0x1ff image: written for the next load, read as it is in force
//
// `irq` is high for an increment that waits, an update that is wanted within the lead, or refused ticks, as 0x021 says.
//
// Where it fails: the state's words (0x018 on) are not read in one clock. Read them between two ticks. While an update is made, the image
// reads zero: the slow path has its memory then.
`timescale 1ns / 1ns
`default_nettype none

module sagnac_correction #(
    parameter RAW_BITS = 16,        // counts of a tick, 2 to 32
    parameter INPUTS = 4,           // most inputs of an image, 1 to 4
    parameter PIECES = 1,           // zones and steps
    parameter HARMONICS = 1,
    parameter DERIVED = 1,          // differences, repeats, warm-ups
    parameter STEP_LIMITS = 1,      // largest steps of a thermometer
    parameter STATE_WORDS = 1,      // remainder, increment, target and k can be read
    parameter QUEUE_BITS = 4,       // 2^QUEUE_BITS increments wait at most, 1 to 10
    parameter IMAGE = ""            // file of words that is checked after `rst`
) (
    input  wire                       clk,
    input  wire                       rst,
    input  wire                       write,
    input  wire        [8:0]          address,
    input  wire        [31:0]         write_data,
    output wire        [31:0]         read_data,
    input  wire                       tick,
    input  wire                       gap,          // with tick: no counts for this tick
    input  wire signed [RAW_BITS-1:0] raw,
    output wire                       due,
    output wire                       refused,
    output wire                       irq,
    output wire                       valid,
    output wire signed [31:0]         counts,
    output wire        [7:0]          status        // {overflow, limited, status of the update in force at the last tick}
);
    localparam [31:0] IDENTIFICATION = 32'h53470001;
    /* verilator lint_off WIDTH */ // parameters are integers, in range
    localparam [2:0] MOST_INPUTS = INPUTS;
    localparam [5:0] COUNT_BITS = RAW_BITS;
    /* verilator lint_on WIDTH */
    localparam [31:0] HARDWARE = {11'd0, STATE_WORDS != 0, STEP_LIMITS != 0, DERIVED != 0, HARMONICS != 0, PIECES != 0,
        5'd0, MOST_INPUTS, 2'd0, COUNT_BITS};

    wire loaded, checking, replaced, write_refused, busy, ready, applied, held, limited, overflow;
    wire [2:0] fault, inputs;
    wire [7:0] fault_word, series_address;
    wire [31:0] image_crc, period_ticks, slew_ticks, output_limit, image_word, ticks_to_update, new_steeper;
    wire [5:0] terms, slow_status, tick_status, new_status;
    wire [3:0] highest_order;
    wire signed [63:0] accumulator;
    wire signed [47:0] increment, target, new_target, new_slope;
    wire [33:0] k, new_k;

    reg load, start, clear, restart, drop, took, took_gap, of_image;
    reg [31:0] register;
    reg [15:0] length, lead;
    reg [2:0] interrupts;
    wire [31:0] increment_number;
    wire signed [31:0] increment_counts;
    wire [7:0] increment_status;
    wire [QUEUE_BITS:0] waiting;
    reg [255:0] serial;
    reg [127:0] codes;
    reg [7:0] axis;
    reg [31:0] tick_ns, refusals;
    reg [3:0] present;

    assign status = {overflow, limited, tick_status};

    sagnac_image #(.INPUTS(INPUTS), .PIECES(PIECES), .HARMONICS(HARMONICS), .DERIVED(DERIVED), .STEP_LIMITS(STEP_LIMITS), .IMAGE(IMAGE)) image (
        .clk(clk), .rst(rst), .write(write && address[8]), .write_address(address[7:0]), .write_data(write_data), .load(load),
        .check_unit(axis != 8'd0), .unit_serial(serial), .unit_axis(axis), .unit_tick_ns(tick_ns), .loaded(loaded), .checking(checking),
        .restart(replaced), .write_refused(write_refused), .fault(fault), .fault_word(fault_word), .image_crc(image_crc),
        .period_ticks(period_ticks), .slew_ticks(slew_ticks), .output_limit(output_limit), .inputs(inputs), .terms(terms),
        .highest_order(highest_order), .address(busy ? series_address : address[7:0]), .word(image_word));
    sagnac_series #(.INPUTS(INPUTS), .PIECES(PIECES), .HARMONICS(HARMONICS), .DERIVED(DERIVED), .STEP_LIMITS(STEP_LIMITS)) series (
        .clk(clk), .rst(rst), .restart(restart || replaced), .start(start && loaded), .codes(codes), .present(present), .target_now(target),
        .taken(applied), .inputs(inputs), .terms(terms), .highest_order(highest_order), .slew_ticks(slew_ticks), .address(series_address),
        .word(image_word), .busy(busy), .ready(ready), .held(held), .k(new_k), .target(new_target), .slope(new_slope),
        .steeper(new_steeper), .status(new_status));
    sagnac_fast #(.RAW_BITS(RAW_BITS)) fast (
        .clk(clk), .rst(rst), .restart(restart || replaced), .clear(clear), .tick(tick), .gap(gap), .raw(raw), .apply(ready),
        .apply_held(held), .apply_k(new_k), .apply_target(new_target), .apply_slope(new_slope), .apply_steeper(new_steeper),
        .apply_status(new_status), .period_ticks(period_ticks), .slew_ticks(slew_ticks), .output_limit(output_limit),
        .applied(applied), .ticks_to_update(ticks_to_update), .status(slow_status), .tick_status(tick_status), .due(due), .refused(refused), .valid(valid),
        .counts(counts), .limited(limited), .overflow(overflow), .accumulator(accumulator), .increment(increment), .target(target), .k(k));

    sagnac_increments #(.DEPTH_BITS(QUEUE_BITS)) increments (
        .clk(clk), .rst(rst), .length(length), .tick(took && !refused), .gap(took_gap), .valid(valid), .counts(counts), .status(status),
        .drop(drop), .waiting(waiting), .number(increment_number), .sum(increment_counts), .all_status(increment_status));

    wire has_increment = waiting != {(QUEUE_BITS + 1){1'b0}};
    wire wants_update = loaded && !busy && !ready && ticks_to_update <= {16'd0, lead};
    assign irq = |(interrupts & {refusals != 32'd0, wants_update, has_increment});
    assign read_data = of_image ? image_word : register;

    wire to_register = write && !address[8];

    always @(posedge clk) begin
        {restart, clear, start, load, drop} <= 5'd0;
        took <= tick;
        took_gap <= gap;
        if (rst) begin
            length <= 16'd0;
            lead <= 16'd0;
            interrupts <= 3'd0;
            took <= 1'b0;
            serial <= 256'd0;
            axis <= 8'd0;
            tick_ns <= 32'd0;
            refusals <= 32'd0;
        end else begin
            // The count of refused ticks stays at its end; a write sets it to zero.
            if (to_register && address[7:0] == 8'h04)
                refusals <= {31'd0, refused};
            else if (refused && !(&refusals))
                refusals <= refusals + 32'd1;
            if (to_register)
                case (address[7:0])
                    8'h01: {restart, clear, load} <= write_data[2:0];
                    8'h06: axis <= write_data[7:0];
                    8'h07: tick_ns <= write_data;
                    8'h08, 8'h09, 8'h0a, 8'h0b, 8'h0c, 8'h0d, 8'h0e, 8'h0f: serial[32*address[2:0] +: 32] <= write_data;
                    8'h10: codes[31:0] <= write_data;
                    8'h11: codes[63:32] <= write_data;
                    8'h12: codes[95:64] <= write_data;
                    8'h13: codes[127:96] <= write_data;
                    8'h14: begin
                        present <= write_data[3:0];
                        start <= 1'b1;
                    end
                    8'h20: length <= write_data[15:0];
                    8'h21: {lead, interrupts} <= {write_data[31:16], write_data[2:0]};
                    8'h22: drop <= 1'b1;
                    default: begin end
                endcase
        end
    end

    wire [31:0] state = {14'd0, write_refused, held, ready, busy, due, checking, loaded, fault, overflow, limited, slow_status};

    always @(posedge clk) begin
        of_image <= address[8] && !busy;
        case (address)
            9'h000: register <= IDENTIFICATION;
            9'h002: register <= state;
            9'h003: register <= ticks_to_update;
            9'h004: register <= refusals;
            9'h005: register <= image_crc;
            9'h006: register <= {24'd0, axis};
            9'h007: register <= tick_ns;
            9'h008, 9'h009, 9'h00a, 9'h00b, 9'h00c, 9'h00d, 9'h00e, 9'h00f: register <= serial[32*address[2:0] +: 32];
            9'h016: register <= HARDWARE;
            9'h017: register <= {24'd0, fault_word};
            9'h018: register <= STATE_WORDS != 0 ? accumulator[31:0] : 32'd0;
            9'h019: register <= STATE_WORDS != 0 ? accumulator[63:32] : 32'd0;
            9'h01a: register <= STATE_WORDS != 0 ? increment[31:0] : 32'd0;
            9'h01b: register <= STATE_WORDS != 0 ? {{16{increment[47]}}, increment[47:32]} : 32'd0;
            9'h01c: register <= STATE_WORDS != 0 ? target[31:0] : 32'd0;
            9'h01d: register <= STATE_WORDS != 0 ? {{16{target[47]}}, target[47:32]} : 32'd0;
            9'h01e: register <= STATE_WORDS != 0 ? k[31:0] : 32'd0;
            9'h01f: register <= STATE_WORDS != 0 ? {30'd0, k[33:32]} : 32'd0;
            9'h020: register <= {16'd0, length};
            9'h021: register <= {lead, 13'd0, interrupts};
            9'h022: register <= {{(31 - QUEUE_BITS){1'b0}}, waiting};
            9'h023: register <= increment_number;
            9'h024: register <= increment_counts;
            9'h025: register <= {24'd0, increment_status};
            default: register <= 32'd0;
        endcase
    end
endmodule

`default_nettype wire
