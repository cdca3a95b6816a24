//! A new image over the serial line: pieces, then a commit; or a roll back to the image before.
//!
//! Pieces may arrive in any order and more than once. The commit decodes, checks and stores the image; the board starts
//! to use it between two ticks. A refused commit changes neither the active image nor the received pieces, so only
//! missing pieces need to be sent again.
//!
//! A store erases and programs flash and takes milliseconds. Call it from the main loop, not from the tick.

use embedded_storage::nor_flash::NorFlash;
use sagnac_core::{Banks, Gyro, Image, Loaded, MAX_IMAGE_LEN, StoreError};

use crate::message::{Message, Reply, ReplyCode};

/// Buffer for an image in pieces.
#[derive(Clone, Debug)]
pub struct Upload {
    bytes: [u8; MAX_IMAGE_LEN],
}

impl Default for Upload {
    fn default() -> Self {
        Self::new()
    }
}

impl Upload {
    /// An empty buffer.
    pub const fn new() -> Self {
        Self { bytes: [0; MAX_IMAGE_LEN] }
    }

    /// Handles a piece, a commit or a roll back. Returns the reply and, if the active image may have changed, what
    /// flash holds now. `None` for every other message.
    pub fn handle<F: NorFlash>(
        &mut self,
        message: &Message,
        banks: &mut Banks<F>,
        gyro: &Gyro,
    ) -> Option<(Reply, Option<Loaded>)> {
        let code = match message {
            Message::Piece { offset, len, bytes } => self.keep(usize::from(*offset), bytes.get(..usize::from(*len))?),
            Message::Commit { len } => self.commit(usize::from(*len), banks, gyro),
            Message::RollBack => banks.roll_back(gyro).map_or_else(of_store, |_| ReplyCode::Done),
            _ => return None,
        };
        let loaded = banks.load(gyro);
        // Use what flash holds, not the code: a failed step may still have changed the active image.
        let changed = !matches!(message, Message::Piece { .. });
        let reply = Reply::new(message.kind(), code, &loaded);
        Some((reply, changed.then_some(loaded)))
    }

    fn keep(&mut self, offset: usize, piece: &[u8]) -> ReplyCode {
        match self.bytes.get_mut(offset..).and_then(|rest| rest.get_mut(..piece.len())) {
            Some(room) => {
                room.copy_from_slice(piece);
                ReplyCode::Done
            }
            None => ReplyCode::BadPiece,
        }
    }

    fn commit<F: NorFlash>(&mut self, len: usize, banks: &mut Banks<F>, gyro: &Gyro) -> ReplyCode {
        let Some(bytes) = self.bytes.get(..len) else { return ReplyCode::BadPiece };
        match Image::decode(bytes) {
            Ok(image) => banks.store(gyro, &image).map_or_else(of_store, |()| ReplyCode::Done),
            Err(_) => ReplyCode::NotAnImage,
        }
    }
}

fn of_store<E>(error: StoreError<E>) -> ReplyCode {
    match error {
        StoreError::Mismatch(_) => ReplyCode::Mismatch,
        StoreError::NotNewer { .. } => ReplyCode::NotNewer,
        StoreError::NoOlderImage => ReplyCode::NoOlderImage,
        StoreError::NoFreeNote | StoreError::StoreCounterFull | StoreError::ReadBack { .. } | StoreError::Flash(_) => {
            ReplyCode::Flash
        }
    }
}
