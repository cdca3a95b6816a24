// Self-checking bench: sagnac_quadrature against reference vectors (docs/reference/vectors.md), all three ways of counting.
`timescale 1ns / 1ns
`default_nettype none

module tb_quadrature;
    reg clk = 1'b0;
    always #5 clk = ~clk;

    reg rst = 1'b1, sample = 1'b0, a = 1'b0, b = 1'b0;
    wire signed [15:0] counts1, counts2, counts4;
    wire signed [1:0] step1, step2, step4;
    wire [31:0] lost1, lost2, lost4;
    sagnac_quadrature #(.COUNTS_PER_FRINGE(1), .SYNCHRONIZED(0)) one (.clk(clk), .rst(rst), .sample(sample), .a(a),
        .b(b), .take(1'b1), .counts(counts1), .step(step1), .lost(lost1));
    sagnac_quadrature #(.COUNTS_PER_FRINGE(2), .SYNCHRONIZED(0)) two (.clk(clk), .rst(rst), .sample(sample), .a(a),
        .b(b), .take(1'b1), .counts(counts2), .step(step2), .lost(lost2));
    sagnac_quadrature #(.COUNTS_PER_FRINGE(4), .SYNCHRONIZED(0)) four (.clk(clk), .rst(rst), .sample(sample), .a(a),
        .b(b), .take(1'b1), .counts(counts4), .step(step4), .lost(lost4));

    // Four bits hold -8 to 7: what comes beyond them is counted as lost.
    reg short_take = 1'b0;
    wire signed [3:0] short_counts;
    wire signed [1:0] short_step;
    wire [31:0] short_lost;
    sagnac_quadrature #(.COUNTS_PER_FRINGE(4), .COUNT_BITS(4), .SYNCHRONIZED(0)) short (.clk(clk), .rst(rst), .sample(sample), .a(a),
        .b(b), .take(short_take), .counts(short_counts), .step(short_step), .lost(short_lost));

    reg [31:0] words [0:131071];
    reg [8*512-1:0] name;
    integer at, record, i, n, pairs;
    reg [31:0] seed, hash, sum, which, place, count;
    reg [31:0] out [0:6];
    reg failed;
    wire signed [1:0] step = which == 1 ? step1 : (which == 2 ? step2 : step4);
    wire [31:0] lost = which == 1 ? lost1 : (which == 2 ? lost2 : lost4);

    task run;
        begin
            seed = words[at + 2];
            hash = 32'd2166136261;
            sum = 32'd0;
            for (n = 0; n < words[at + 1]; n = n + 1) begin
                seed = seed * 32'd1664525 + 32'd1013904223;
                place = (place + (seed < words[at + 3] ? 1 : (seed < words[at + 4] ? 3 : (seed < words[at + 5] ? 2 : 0)))) & 3;
                @(negedge clk);
                a = place == 1 || place == 2;
                b = place == 2 || place == 3;
                sample = 1'b1;
                @(negedge clk) sample = 1'b0;
                count = {{30{step[1]}}, step};
                sum = sum + count;
                hash = (hash ^ count) * 32'd16777619;
                pairs = pairs + 1;
            end
            out[0] = sum;
            out[1] = lost;
            out[2] = hash;
            out[3] = place;
        end
    endtask

    // So many quarter steps (forward 1, back 3), then the counts and the losses of the short counter.
    task beyond(input integer steps, input [31:0] by, input signed [3:0] wanted, input [31:0] lost_in_all);
        begin
            for (n = 0; n < steps; n = n + 1) begin
                place = (place + by) & 3;
                @(negedge clk);
                a = place == 1 || place == 2;
                b = place == 2 || place == 3;
                sample = 1'b1;
                @(negedge clk) sample = 1'b0;
            end
            short_take = 1'b1;
            @(negedge clk) short_take = 1'b0;
            if (!failed && (short_counts !== wanted || short_lost !== lost_in_all)) begin
                $display("FAILED: %0d steps in four bits: %0d counts, %0d lost", steps, short_counts, short_lost);
                failed = 1'b1;
            end
        end
    endtask

    initial begin
        failed = 1'b0;
        pairs = 0;
        which = 32'd4;
        place = 32'd0;
        if (!$value$plusargs("vectors=%s", name)) begin
            $display("FAILED: +vectors=FILE is missing");
            $finish;
        end
        $readmemh(name, words);
        if (words[0] !== 32'h5a67ac01 || words[1] !== 32'd4) begin
            $display("FAILED: not a vector file of the quadrature counter");
            failed = 1'b1;
        end
        at = 4 + (words[2] + 3) / 4;
        for (record = 0; record < words[3] && !failed; record = record + 1) begin
            for (i = 0; i < 7; i = i + 1)
                out[i] = 32'd0;
            if (words[at] == 32'd0) begin
                which = words[at + 1];
                place = 32'd0;
                @(negedge clk) rst = 1'b1;
                @(negedge clk) rst = 1'b0;
            end else
                run;
            for (i = 0; i < 7; i = i + 1)
                if (!failed && out[i] !== words[at + 9 + i]) begin
                    $display("FAILED: record %0d, output %0d: %h, the vectors say %h", record, i, out[i], words[at + 9 + i]);
                    failed = 1'b1;
                end
            at = at + 16;
        end
        place = 32'd0;
        a = 1'b0;
        b = 1'b0;
        @(negedge clk) rst = 1'b1;
        @(negedge clk) rst = 1'b0;
        sample = 1'b1;
        @(negedge clk) sample = 1'b0;
        beyond(7, 1, 4'sd7, 32'd0);
        beyond(10, 1, 4'sd7, 32'd3);
        beyond(8, 3, -4'sd8, 32'd3);
        beyond(9, 3, -4'sd8, 32'd4);
        if (!failed && pairs > 0)
            $display("PASSED: %0d records, %0d pairs of levels", record, pairs);
        if (!failed && !(pairs > 0))
            $display("FAILED: nothing was run");
        $finish;
    end
endmodule

`default_nettype wire
