// Self-checking bench: sagnac_path_length against the records of reference vectors (docs/reference/vectors.md) in which the loop is
// closed all along; the others belong to the processor that searches and resets.
`timescale 1ns / 1ns
`default_nettype none

module tb_path_length;
`include "sagnac_path_unit.vh"
    reg clk = 1'b0;
    always #5 clk = ~clk;

    reg rst = 1'b1, tick = 1'b0, preset = 1'b0;
    reg signed [23:0] code = 24'sd0;
    reg signed [63:0] preset_value = 64'sd0;
    wire period;
    wire signed [31:0] error, held, modulation;
    wire signed [39:0] plain;
    wire signed [47:0] second;
    wire signed [63:0] integral;
    sagnac_path_length dut (.clk(clk), .rst(rst), .tick(tick), .code(code), .closed(1'b1), .preset(preset),
        .preset_value(preset_value), .period(period), .error(error), .plain(plain), .second(second), .integral(integral), .held(held),
        .modulation(modulation));

    reg [31:0] words [0:131071];
    reg [8*512-1:0] name;
    integer at, record, n, ticks, runs;
    reg [31:0] seed, hash;
    reg failed;
    reg period_ended = 1'b0;
    always @(posedge clk)
        if (period)
            period_ended = 1'b1;
    reg signed [63:0] place, d, light;
    reg signed [31:0] noise;
    reg [63:0] squared;
    reg [127:0] loss;

    task plant;
        begin
            place = place + $signed({{16{words[at + 5][31]}}, words[at + 5], 16'd0});
            seed = seed * 32'd1664525 + 32'd1013904223;
            noise = words[at + 8][7:0] == 0 ? 32'sd0
                : $signed((seed >> (32 - words[at + 8][7:0])) - (32'd1 << (words[at + 8][7:0] - 1)));
            d = ($signed({{32{held[31]}}, held}) + $signed({{32{modulation[31]}}, modulation}) - (place >>> 32)) % WAVELENGTH;
            if (d < 0)
                d = d + WAVELENGTH;
            if (d > WAVELENGTH / 2)
                d = d - WAVELENGTH;
            squared = d * d;
            loss = {64'd0, squared} * {96'd0, words[at + 7]};
            light = (words[at + 8][9] ? $signed({32'd0, words[at + 6]}) : 64'sd0) - $signed(loss[95:32]);
            if (light < 0)
                light = 0;
            light = light + noise;
            code = light > 64'sd8388607 ? 24'sd8388607 : light[23:0];
        end
    endtask

    task run;
        begin
            @(negedge clk);
            // Where the record before it left the integrator.
            preset_value = {words[at - 16 + 15], words[at - 16 + 14]};
            preset = 1'b1;
            @(negedge clk) preset = 1'b0;
            seed = words[at + 2];
            hash = 32'd2166136261;
            place = {words[at + 4], words[at + 3]};
            for (n = 0; n < words[at + 1]; n = n + 1) begin
                @(negedge clk);
                plant;
                period_ended = 1'b0;
                tick = 1'b1;
                @(negedge clk) tick = 1'b0;
                repeat (8) @(negedge clk);
                hash = (hash ^ held) * 32'd16777619;
                hash = (hash ^ modulation) * 32'd16777619;
                if (period_ended)
                    hash = (hash ^ second[31:0]) * 32'd16777619;
                ticks = ticks + 1;
            end
            runs = runs + 1;
            if (hash !== words[at + 9] || error !== words[at + 12] || held !== words[at + 13]
                || integral !== {words[at + 15], words[at + 14]}) begin
                $display("FAILED: record %0d: %h %h %h %h, the vectors say %h %h %h %h%h", record, hash, error, held, integral,
                    words[at + 9], words[at + 12], words[at + 13], words[at + 15], words[at + 14]);
                failed = 1'b1;
            end
        end
    endtask

    initial begin
        failed = 1'b0;
        ticks = 0;
        runs = 0;
        if (!$value$plusargs("vectors=%s", name)) begin
            $display("FAILED: +vectors=FILE is missing");
            $finish;
        end
        $readmemh(name, words);
        if (words[0] !== 32'h5a67ac01 || words[1] !== 32'd2) begin
            $display("FAILED: not a vector file of the path-length loop");
            failed = 1'b1;
        end
        repeat (3) @(negedge clk);
        rst = 1'b0;
        at = 4 + (words[2] + 3) / 4;
        if (!failed && words[at - 1] !== TABLE_CRC) begin
            $display("FAILED: the vectors hold another table of the loops than this export: export the vector file itself");
            failed = 1'b1;
        end
        for (record = 0; record < words[3] && !failed; record = record + 1) begin
            if (words[at] == 32'd1 && words[at + 8][8])
                run;
            at = at + 16;
        end
        if (!failed && runs > 0)
            $display("PASSED: %0d records with the loop closed, %0d ticks", runs, ticks);
        if (!failed && !(runs > 0))
            $display("FAILED: nothing was run");
        $finish;
    end
endmodule

`default_nettype wire
