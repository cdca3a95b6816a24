//! The serial line of a board's main loop: messages in, replies and output frames out.
//!
//! ```text
//! embedded-io Read ─▶ FrameReader ─▶ Upload ─▶ flash banks ─▶ what flash holds now ─▶ board, between two ticks
//! embedded-io Write ◀─ replies, output frames
//! ```
//!
//! A message may erase flash or check a signature, so the line belongs into the main loop, below the tick. Nothing waits for bytes that have
//! not arrived; writing waits as the port does.

use embedded_io::{Read, ReadReady, Write};
use embedded_storage::nor_flash::NorFlash;
use sagnac_core::{Banks, Gyro, Loaded, Trust};

use crate::frame::{Frame, FrameReader};
use crate::message::{Message, OutputFrame};
use crate::upload::Upload;

/// Bytes that are read at once.
const PIECE: usize = 64;

/// A serial line with the flash banks behind it.
#[derive(Debug)]
pub struct Line<L, F, T> {
    port: L,
    banks: Banks<F>,
    gyro: Gyro,
    upload: Upload<T>,
    reader: FrameReader,
}

impl<L: Read + ReadReady + Write, F: NorFlash, T: Trust> Line<L, F, T> {
    /// Power-on or reset: counts a start of an image on trial, and says on the line what runs. Make the board of the image that is returned.
    /// `watchdog_resets`: see [`Banks::start`].
    ///
    /// # Errors
    /// Those of the port.
    pub fn power_on(
        mut port: L,
        mut banks: Banks<F>,
        gyro: Gyro,
        trust: T,
        watchdog_resets: u32,
    ) -> Result<(Self, Loaded), L::Error> {
        let loaded = banks.start(&gyro, watchdog_resets);
        let mut upload = Upload::new(trust);
        write(&mut port, &Message::Reply(upload.power_on(&loaded)), gyro.axis)?;
        let line = Self { port, banks, gyro, upload, reader: FrameReader::new() };
        Ok((line, loaded))
    }

    /// Handles what has arrived. `use_image` gets what flash holds after a message that may have changed it: give it to
    /// [`Board::use_loaded`](crate::Board::use_loaded) with the tick's interrupt masked. True if any byte was there.
    ///
    /// # Errors
    /// Those of the port.
    pub fn poll(&mut self, mut use_image: impl FnMut(&Loaded)) -> Result<bool, L::Error> {
        if !self.port.read_ready()? {
            return Ok(false);
        }
        let mut bytes = [0; PIECE];
        let read = self.port.read(&mut bytes)?;
        for byte in bytes.iter().take(read) {
            if let Some(frame) = self.reader.push(*byte) {
                self.handle(&frame, &mut use_image)?;
            }
        }
        Ok(read > 0)
    }

    /// The line has been quiet for longer than a sender pauses within a frame: what was begun is no frame any more.
    ///
    /// # Errors
    /// Those of the port.
    pub fn quiet(&mut self, mut use_image: impl FnMut(&Loaded)) -> Result<(), L::Error> {
        while let Some(frame) = self.reader.next_quiet() {
            self.handle(&frame, &mut use_image)?;
        }
        Ok(())
    }

    /// A second has passed: call it once a second. The service mode of a board with a key ends by itself.
    pub const fn second(&mut self) {
        self.upload.second();
    }

    /// Sends an output frame.
    ///
    /// # Errors
    /// Those of the port.
    pub fn send(&mut self, output: OutputFrame) -> Result<(), L::Error> {
        write(&mut self.port, &Message::Output(output), self.gyro.axis)
    }

    /// What flash holds, for [`Board::mend`](crate::Board::mend).
    pub fn load(&mut self) -> Loaded {
        self.banks.load(&self.gyro)
    }

    fn handle(&mut self, frame: &Frame, use_image: &mut impl FnMut(&Loaded)) -> Result<(), L::Error> {
        let Some(message) = Message::parse(frame).filter(|_| frame.is_for(self.gyro.axis)) else { return Ok(()) };
        let Some(handled) = self.upload.handle(&message, &mut self.banks, &self.gyro) else { return Ok(()) };
        if let Some(loaded) = &handled.loaded {
            use_image(loaded);
        }
        write(&mut self.port, &handled.message, self.gyro.axis)
    }
}

fn write<L: Write>(port: &mut L, message: &Message, axis: u8) -> Result<(), L::Error> {
    let Some(frame) = message.frame() else { return Ok(()) };
    let (bytes, len) = frame.of_axis(axis).bytes();
    let mut rest = bytes.get(..len).unwrap_or(&[]);
    // Not `write_all`, which panics for a port that takes nothing.
    while !rest.is_empty() {
        let written = port.write(rest)?;
        if written == 0 {
            break;
        }
        rest = rest.get(written..).unwrap_or(&[]);
    }
    Ok(())
}
