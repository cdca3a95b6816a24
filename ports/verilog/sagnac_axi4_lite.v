// The whole correction (sagnac_correction) behind AXI4-Lite, 32 bits of data, 2 KiB of addresses: byte address = 4 x word address.
//
// Write address and write data come in any order. A write with a strobe that is not 1111 changes nothing and answers SLVERR; an
// address that no register has reads zero. One write and one read can be under way; a read answers after two clocks.
//
// Where it fails: nothing here crosses clocks. `tick` and its counts belong to the bus' clock.
`timescale 1ns / 1ns
`default_nettype none

module sagnac_axi4_lite #(
    parameter RAW_BITS = 16,
    parameter INPUTS = 4,
    parameter PIECES = 1,
    parameter HARMONICS = 1,
    parameter DERIVED = 1,
    parameter STEP_LIMITS = 1,
    parameter STATE_WORDS = 1,
    parameter QUEUE_BITS = 4,
    parameter IMAGE = ""
) (
    input  wire                       s_axi_aclk,
    input  wire                       s_axi_aresetn,
    /* verilator lint_off UNUSEDSIGNAL */ // registers are whole words, and their protection is the bus'
    input  wire        [10:0]         s_axi_awaddr,
    input  wire        [2:0]          s_axi_awprot,
    input  wire        [10:0]         s_axi_araddr,
    input  wire        [2:0]          s_axi_arprot,
    /* verilator lint_on UNUSEDSIGNAL */
    input  wire                       s_axi_awvalid,
    output wire                       s_axi_awready,
    input  wire        [31:0]         s_axi_wdata,
    input  wire        [3:0]          s_axi_wstrb,
    input  wire                       s_axi_wvalid,
    output wire                       s_axi_wready,
    output reg         [1:0]          s_axi_bresp,
    output reg                        s_axi_bvalid,
    input  wire                       s_axi_bready,
    input  wire                       s_axi_arvalid,
    output wire                       s_axi_arready,
    output wire        [31:0]         s_axi_rdata,
    output wire        [1:0]          s_axi_rresp,
    output reg                        s_axi_rvalid,
    input  wire                       s_axi_rready,
    input  wire                       tick,
    input  wire                       gap,
    input  wire signed [RAW_BITS-1:0] raw,
    output wire                       due,
    output wire                       refused,
    output wire                       irq,
    output wire                       valid,
    output wire signed [31:0]         counts,
    output wire        [7:0]          status
);
    localparam [1:0] OKAY = 2'b00, SLVERR = 2'b10;

    reg has_write_address, has_write_data, reads, has_read;
    reg [8:0] write_address, read_address;
    reg [31:0] write_data, data;
    reg [3:0] strobe;
    wire [31:0] read_data;

    assign s_axi_awready = !has_write_address;
    assign s_axi_wready = !has_write_data;
    assign s_axi_arready = !reads && !s_axi_rvalid;
    assign s_axi_rdata = data;
    assign s_axi_rresp = OKAY;

    wire writes = has_write_address && has_write_data && !s_axi_bvalid;

    sagnac_correction #(.RAW_BITS(RAW_BITS), .INPUTS(INPUTS), .PIECES(PIECES), .HARMONICS(HARMONICS), .DERIVED(DERIVED),
                        .STEP_LIMITS(STEP_LIMITS), .STATE_WORDS(STATE_WORDS), .QUEUE_BITS(QUEUE_BITS), .IMAGE(IMAGE)) correction (
        .clk(s_axi_aclk), .rst(!s_axi_aresetn), .write(writes && strobe == 4'b1111), .address(writes ? write_address : read_address),
        .write_data(write_data), .read_data(read_data), .tick(tick), .gap(gap), .raw(raw), .due(due), .refused(refused),
        .irq(irq), .valid(valid), .counts(counts), .status(status));

    always @(posedge s_axi_aclk)
        if (!s_axi_aresetn) begin
            has_write_address <= 1'b0;
            has_write_data <= 1'b0;
            s_axi_bvalid <= 1'b0;
            s_axi_bresp <= OKAY;
            reads <= 1'b0;
            has_read <= 1'b0;
            s_axi_rvalid <= 1'b0;
        end else begin
            if (s_axi_awvalid && s_axi_awready) begin
                write_address <= s_axi_awaddr[10:2];
                has_write_address <= 1'b1;
            end
            if (s_axi_wvalid && s_axi_wready) begin
                write_data <= s_axi_wdata;
                strobe <= s_axi_wstrb;
                has_write_data <= 1'b1;
            end
            if (s_axi_bvalid && s_axi_bready)
                s_axi_bvalid <= 1'b0;
            if (writes) begin
                has_write_address <= 1'b0;
                has_write_data <= 1'b0;
                s_axi_bvalid <= 1'b1;
                s_axi_bresp <= strobe == 4'b1111 ? OKAY : SLVERR;
            end
            // A read waits for a clock in which nothing is written, and its data come in the clock behind that one.
            if (s_axi_arvalid && s_axi_arready) begin
                read_address <= s_axi_araddr[10:2];
                reads <= 1'b1;
            end
            has_read <= reads && !has_read && !writes;
            if (has_read) begin
                data <= read_data;
                reads <= 1'b0;
                s_axi_rvalid <= 1'b1;
            end
            if (s_axi_rvalid && s_axi_rready)
                s_axi_rvalid <= 1'b0;
        end
endmodule

`default_nettype wire
