// Self-checking bench: sagnac_fast and sagnac_series against a file of reference vectors (docs/reference/vectors.md).
//
//     +vectors=FILE   [+records=N]     prints PASSED and what was run, or FAILED and the first record that differs
//
// An advance of n ticks is run as n single ticks, the counts in the first.
`timescale 1ns / 1ns
`default_nettype none

module tb_compensator;
`include "sagnac_unit.vh"
    reg clk = 1'b0;
    always #5 clk = ~clk;

    reg rst = 1'b1, restart = 1'b0, clear = 1'b0, tick = 1'b0, gap = 1'b0, start = 1'b0;
    reg signed [RAW_WIDTH-1:0] raw = {RAW_WIDTH{1'b0}};
    reg [127:0] codes = 128'd0;
    reg [3:0] present = 4'd0;
    wire due, refused, valid, limited, overflow, busy, ready, applied, held;
    wire signed [31:0] counts;
    wire signed [63:0] accumulator;
    wire signed [INCREMENT_WIDTH-1:0] increment, target, new_target, new_slope;
    wire signed [63:0] increment_wide = {{(64 - INCREMENT_WIDTH){increment[INCREMENT_WIDTH-1]}}, increment};
    wire signed [63:0] target_wide = {{(64 - INCREMENT_WIDTH){target[INCREMENT_WIDTH-1]}}, target};
    wire [33:0] k, new_k;
    wire [31:0] new_steeper;
    wire [5:0] slow_status, new_status;

    sagnac_fast #(.RAW_BITS(RAW_WIDTH), .INCREMENT_BITS(INCREMENT_WIDTH), .PERIOD_TICKS(PERIOD_TICKS), .SLEW_TICKS(SLEW_TICKS),
                  .OUTPUT_LIMIT(OUTPUT_LIMIT)) fast (
        .clk(clk), .rst(rst), .restart(restart), .clear(clear), .tick(tick), .gap(gap), .raw(raw), .apply(ready), .applied(applied),
        .apply_status(new_status), .status(slow_status), .apply_held(held),
        .apply_k(new_k), .apply_target(new_target), .apply_slope(new_slope), .apply_steeper(new_steeper), .due(due),
        .refused(refused), .valid(valid), .counts(counts), .limited(limited), .overflow(overflow),
        .accumulator(accumulator), .increment(increment), .target(target), .k(k));
    sagnac_series #(.INCREMENT_BITS(INCREMENT_WIDTH), .ORDER(HIGHEST_ORDER)) series (
        .clk(clk), .rst(rst), .restart(restart), .start(start), .codes(codes), .present(present), .target_now(target),
        .taken(applied), .busy(busy), .ready(ready), .held(held), .k(new_k), .target(new_target), .slope(new_slope), .steeper(new_steeper),
        .status(new_status));

    reg [31:0] words [0:131071];
    reg [8*512-1:0] name;
    integer records, at, record, i;
    reg [31:0] in [0:7];
    reg [31:0] out [0:6];
    reg [31:0] seed, hash, sum, status, last;
    reg signed [31:0] wanted;
    reg failed, started, early;
    integer ticks, longest, clocks;

    wire [31:0] tick_status = {24'd0, overflow, limited, slow_status};
    wire [31:0] state_status = {24'd0, overflow, 1'b0, slow_status};

    task noise(input [31:0] bits, output signed [31:0] value);
        begin
            seed = seed * 32'd1664525 + 32'd1013904223;
            value = bits == 0 ? 32'sd0 : $signed((seed >> (32 - bits)) - (32'd1 << (bits - 1)));
        end
    endtask

    task take(input [31:0] word);
        hash = (hash ^ word) * 32'd16777619;
    endtask

    // Inputs change between two rising edges.
    task one_tick(input signed [31:0] value, input without);
        begin
            @(negedge clk);
            raw = value[RAW_WIDTH-1:0];
            if ({{(32 - RAW_WIDTH + 1){raw[RAW_WIDTH-1]}}, raw[RAW_WIDTH-2:0]} !== value && !failed) begin
                $display("FAILED: record %0d has %0d counts in a tick, more than RAW_WIDTH = %0d holds", record, value, RAW_WIDTH);
                failed = 1'b1;
            end
            gap = without;
            tick = 1'b1;
            @(negedge clk);
            tick = 1'b0;
            status = tick_status;
            if (!refused && !without) begin
                while (!valid)
                    @(negedge clk);
                status = tick_status;
            end
            if (!refused)
                ticks = ticks + 1;
        end
    endtask

    task pulse_restart;
        begin
            @(negedge clk) restart = 1'b1;
            @(negedge clk) restart = 1'b0;
        end
    endtask

    task with_state;
        begin
            out[3] = accumulator[31:0];
            out[4] = accumulator[63:32];
            out[5] = increment_wide[31:0];
            out[6] = increment_wide[63:32];
        end
    endtask

    // Begins the slow path with the inputs of the record at `from`; they may change behind the start.
    task begin_update(input integer from);
        begin
            @(negedge clk);
            present = words[from + 1][3:0];
            codes = {words[from + 5], words[from + 4], words[from + 3], words[from + 2]};
            start = 1'b1;
            @(negedge clk) start = 1'b0;
            present = ~present;
            codes = ~codes;
            started = 1'b1;
        end
    endtask

    task update;
        begin
            if (!due)
                out[0] = 32'd2;
            else begin
                clocks = 0;
                if (!started)
                    begin_update(at);
                started = 1'b0;
                while (!applied && due) begin
                    @(negedge clk);
                    clocks = clocks + 1;
                end
                if (clocks > longest)
                    longest = clocks;
                if (due)
                    @(negedge clk);
                out[1] = state_status;
            end
            out[2] = k[31:0];
            out[3] = {30'd0, k[33:32]};
            out[4] = target_wide[31:0];
            out[5] = target_wide[63:32];
        end
    endtask

    task run;
        integer n;
        begin
            seed = in[1];
            hash = 32'd2166136261;
            sum = 32'd0;
            last = 32'd0;
            for (n = 0; n < in[0]; n = n + 1) begin
                // As hardware does it: two ticks ahead, where the run goes just to the boundary.
                if (in[0] - n == 2 && fast.ticks_to_update == 32'd2 && words[at + 16] == 32'd1 && record + 1 < records)
                    begin_update(at + 16);
                noise(in[3], wanted);
                wanted = wanted + $signed(in[2]);
                one_tick(wanted, 1'b0);
                if (refused) begin
                    last = due ? 32'h10000 : 32'h30000;
                    n = in[0];
                end else begin
                    sum = sum + counts;
                    last = status;
                    take(counts);
                    take(status);
                end
            end
            with_state;
            out[2] = out[3];
            out[3] = out[4];
            out[4] = out[5];
            out[5] = increment_wide[63:32];
            out[0] = sum;
            out[1] = hash;
            out[6] = last;
        end
    endtask

    task advance;
        integer n;
        begin
            if ($signed(in[0]) > 32'sd536870912 || $signed(in[0]) < -32'sd536870912)
                out[0] = 32'd3;
            else if (in[1] > fast.ticks_to_update)
                out[0] = 32'd1;
            else
                for (n = 0; n < in[1]; n = n + 1) begin
                    one_tick(n == 0 ? $signed(in[0]) : 32'sd0, 1'b0);
                    out[1] = out[1] + counts;
                    out[2] = status;
                end
            with_state;
        end
    endtask

    task skip;
        integer n;
        begin
            if (in[0] > fast.ticks_to_update)
                out[0] = 32'd1;
            else
                for (n = 0; n < in[0]; n = n + 1)
                    one_tick(32'sd0, 1'b1);
            @(negedge clk);
            out[1] = fast.ticks_to_update;
            with_state;
        end
    endtask

    // A tick while the one before it is being summed is refused, whichever clock it comes in, and changes nothing: no count is lost unseen.
    task too_early;
        integer gap_clocks;
        reg [31:0] ticks_before;
        reg signed [63:0] once;
        begin
            for (gap_clocks = 0; gap_clocks < 2; gap_clocks = gap_clocks + 1) begin
                @(negedge clk);
                raw = {{(RAW_WIDTH - 1){1'b0}}, 1'b1};
                gap = 1'b0;
                ticks_before = fast.ticks_to_update;
                tick = 1'b1;
                @(negedge clk) tick = 1'b0;
                repeat (gap_clocks) @(negedge clk);
                tick = 1'b1;
                @(negedge clk) tick = 1'b0;
                if (!failed && (!refused || fast.ticks_to_update !== ticks_before - 32'd1)) begin
                    $display("FAILED: a tick %0d clocks behind another is not refused", gap_clocks + 1);
                    failed = 1'b1;
                end
                repeat (3) @(negedge clk);
                once = accumulator;
                repeat (3) @(negedge clk);
                if (!failed && accumulator !== once) begin
                    $display("FAILED: a refused tick changes the accumulator");
                    failed = 1'b1;
                end
            end
            // Three clocks apart: taken.
            @(negedge clk) tick = 1'b1;
            @(negedge clk) tick = 1'b0;
            repeat (2) @(negedge clk);
            tick = 1'b1;
            @(negedge clk) tick = 1'b0;
            if (!failed && refused) begin
                $display("FAILED: a tick three clocks behind another is refused");
                failed = 1'b1;
            end
        end
    endtask

    initial begin
        failed = 1'b0;
        started = 1'b0;
        ticks = 0;
        longest = 0;
        if (!$value$plusargs("vectors=%s", name)) begin
            $display("FAILED: +vectors=FILE is missing");
            $finish;
        end
        $readmemh(name, words);
        if (words[0] !== 32'h5a67ac01 || words[1] !== 32'd1) begin
            $display("FAILED: not a vector file of the compensator");
            failed = 1'b1;
        end
        if (!$value$plusargs("records=%d", records) || records > words[3])
            records = words[3];
        repeat (3) @(negedge clk);
        rst = 1'b0;
        at = 4 + (words[2] + 3) / 4;
        if (!failed && words[at - 1] !== IMAGE_CRC) begin
            $display("FAILED: the vectors hold another image than this export: export the vector file itself");
            failed = 1'b1;
        end
        for (record = 0; record < records && !failed; record = record + 1) begin
            for (i = 0; i < 8; i = i + 1)
                in[i] = words[at + 1 + i];
            for (i = 0; i < 7; i = i + 1)
                out[i] = 32'd0;
            case (words[at])
                32'd0: begin
                    @(negedge clk) rst = 1'b1;
                    @(negedge clk) rst = 1'b0;
                end
                32'd1: update;
                32'd2: run;
                32'd3: advance;
                32'd4: skip;
                32'd5: begin
                    pulse_restart;
                    out[2] = state_status;
                    with_state;
                end
                32'd6: begin
                    @(negedge clk) clear = 1'b1;
                    @(negedge clk) clear = 1'b0;
                    out[2] = state_status;
                    with_state;
                end
                default: begin
                    $display("FAILED: record %0d: no operation %0d", record, words[at]);
                    failed = 1'b1;
                end
            endcase
            for (i = 0; i < 7; i = i + 1)
                if (!failed && out[i] !== words[at + 9 + i]) begin
                    $display("FAILED: record %0d, output %0d: %h, the vectors say %h", record, i, out[i], words[at + 9 + i]);
                    failed = 1'b1;
                end
            at = at + 16;
        end
        // At the end of the vectors: a power-on, an update without samples, and a period with room for four ticks.
        @(negedge clk) rst = 1'b1;
        @(negedge clk) rst = 1'b0;
        present = 4'd0;
        @(negedge clk) start = 1'b1;
        @(negedge clk) start = 1'b0;
        while (due)
            @(negedge clk);
        early = fast.ticks_to_update >= 32'd4;
        if (!failed && early)
            too_early;
        if (!failed && ticks > 0)
            $display("PASSED: %0d records, %0d ticks, slow path %0d clocks at most%0s", records, ticks, longest,
                     early ? ", early ticks refused" : "");
        if (!failed && !(ticks > 0))
            $display("FAILED: nothing was run");
        $finish;
    end
endmodule

`default_nettype wire
