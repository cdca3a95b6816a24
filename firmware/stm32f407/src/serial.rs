//! The serial line on USART2 (PA2, PA3), 115,200 baud, both directions by DMA.
//!
//! ```text
//! line ─▶ DMA1 stream 5 ─▶ ring of 512 bytes ─▶ read         write ─▶ ring of 2,048 bytes ─▶ DMA1 stream 6 ─▶ line
//! ```
//!
//! Received bytes are stored while the processor stands still in an erase. A sender that does not wait for its reply can overrun the ring;
//! the frame's CRC finds that, and the piece is sent again.

use core::convert::Infallible;
use core::ptr::{addr_of, addr_of_mut};
use core::sync::atomic::{Ordering, compiler_fence};

use embedded_io::{ErrorType, Read, ReadReady, Write};
use stm32f4::stm32f407::{DMA1, GPIOA, RCC, USART2};

use crate::clocks::SLOW_BUS_HZ;

const BAUD: u32 = 115_200;
/// The clock's divider in sixteenths.
const DIVIDER: u16 = ((SLOW_BUS_HZ + BAUD / 2) / BAUD) as u16;
const HEARD: usize = 512;
const SAID: usize = 2048;
/// Streams of DMA1 and their channel for USART2 (RM0090, table 42).
const RECEIVE: usize = 5;
const SEND: usize = 6;
const CHANNEL: u8 = 4;

static mut HEARD_RING: [u8; HEARD] = [0; HEARD];
static mut SAID_RING: [u8; SAID] = [0; SAID];

/// The serial port. There is one: it owns USART2, DMA1 and both rings.
pub struct Serial {
    dma: DMA1,
    port: USART2,
    /// Next byte of the receive ring to read.
    read_at: usize,
    /// Next free byte of the send ring, its waiting bytes, and those of them that the DMA is sending.
    write_at: usize,
    waiting: usize,
    sending: usize,
}

impl Serial {
    /// Switches port and DMA on.
    pub fn start(rcc: &RCC, pins: &GPIOA, port: USART2, dma: DMA1) -> Self {
        rcc.ahb1enr().modify(|_, w| w.gpioaen().enabled().dma1en().enabled());
        rcc.apb1enr().modify(|_, w| w.usart2en().enabled());
        pins.afrl().modify(|_, w| w.afrl2().af7().afrl3().af7());
        pins.pupdr().modify(|_, w| w.pupdr3().pull_up());
        pins.moder().modify(|_, w| w.moder2().alternate().moder3().alternate());

        // SAFETY: 365 sixteenths, which is 0.1 % from 115,200 baud.
        port.brr().write(|w| unsafe { w.bits(DIVIDER) });
        port.cr3().write(|w| w.dmat().enabled().dmar().enabled());
        port.cr1().write(|w| w.ue().enabled().te().enabled().re().enabled());

        let data = port.dr().as_ptr() as u32;
        let receive = dma.st(RECEIVE);
        // SAFETY: addresses of this port's data register and of a ring that nothing else writes.
        unsafe {
            receive.par().write(|w| w.bits(data));
            receive.m0ar().write(|w| w.bits(addr_of_mut!(HEARD_RING) as u32));
            receive.ndtr().write(|w| w.bits(HEARD as u32));
            receive.cr().write(|w| w.chsel().bits(CHANNEL).minc().incremented().circ().enabled().en().enabled());
            dma.st(SEND).par().write(|w| w.bits(data));
        }
        Self { dma, port, read_at: 0, write_at: 0, waiting: 0, sending: 0 }
    }

    /// Where the DMA writes its next byte.
    fn heard_at(&self) -> usize {
        let rest = self.dma.st(RECEIVE).ndtr().read().bits() as usize;
        HEARD.saturating_sub(rest) % HEARD
    }

    /// Ends a piece that was sent, and begins the next one. Call it in the main loop.
    pub fn pump(&mut self) {
        let stream = self.dma.st(SEND);
        if stream.cr().read().en().is_enabled() {
            return;
        }
        self.waiting -= self.sending.min(self.waiting);
        self.sending = 0;
        if self.waiting == 0 {
            return;
        }
        let from = (self.write_at + SAID - self.waiting) % SAID;
        self.sending = self.waiting.min(SAID - from);
        // The flags of the last piece would stop this one.
        self.dma
            .hifcr()
            .write(|w| w.ctcif6().clear().chtif6().clear().cteif6().clear().cdmeif6().clear().cfeif6().clear());
        compiler_fence(Ordering::Release);
        // SAFETY: a piece of the send ring, which is not written before the stream has ended.
        unsafe {
            stream.m0ar().write(|w| w.bits(addr_of!(SAID_RING) as u32 + from as u32));
            stream.ndtr().write(|w| w.bits(self.sending as u32));
            stream
                .cr()
                .write(|w| w.chsel().bits(CHANNEL).minc().incremented().dir().memory_to_peripheral().en().enabled());
        }
    }
}

impl ErrorType for Serial {
    type Error = Infallible;
}

impl ReadReady for Serial {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        self.pump();
        // An overrun or a wrong level is a byte that the frame's CRC misses; reading both registers clears its flag.
        let state = self.port.sr().read();
        if state.ore().bit_is_set() || state.fe().bit_is_set() || state.nf().bit_is_set() {
            let _ = self.port.dr().read();
        }
        Ok(self.heard_at() != self.read_at)
    }
}

impl Read for Serial {
    fn read(&mut self, room: &mut [u8]) -> Result<usize, Infallible> {
        let mut read = 0;
        for slot in room {
            if read > 0 && self.heard_at() == self.read_at {
                break;
            }
            while self.heard_at() == self.read_at {}
            // SAFETY: within the ring; the DMA writes it, so it is read as volatile.
            *slot = unsafe { addr_of!(HEARD_RING).cast::<u8>().add(self.read_at).read_volatile() };
            self.read_at = (self.read_at + 1) % HEARD;
            read += 1;
        }
        Ok(read)
    }
}

impl Write for Serial {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        while !bytes.is_empty() && self.waiting == SAID {
            self.pump();
        }
        let fitting = bytes.iter().take(SAID - self.waiting.min(SAID));
        let mut written = 0;
        for byte in fitting {
            // SAFETY: within the ring, in the part that no DMA reads.
            unsafe { addr_of_mut!(SAID_RING).cast::<u8>().add(self.write_at).write_volatile(*byte) };
            self.write_at = (self.write_at + 1) % SAID;
            written += 1;
        }
        self.waiting += written;
        self.pump();
        Ok(written)
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        while self.waiting > 0 {
            self.pump();
        }
        Ok(())
    }
}
