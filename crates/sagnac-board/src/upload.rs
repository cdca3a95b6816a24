//! A new image over the line: pieces, then a commit; or back to the one before.
//!
//! ChunkReader may come in any order and more than once. The commit decodes, checks and stores; the board takes the image
//! over between two ticks. A commit that is refused leaves the image in force, and the pieces, so that only what was
//! missing need be sent again.
//!
//! Storing erases and programs flash and takes milliseconds: it belongs into the main loop, not the tick.

use embedded_storage::nor_flash::NorFlash;
use sagnac_core::{Banks, Gyro, Image, Loaded, MAX_IMAGE_LEN, StoreError};

use crate::message::{Message, Reply, ReplyCode};

/// The room for an image in pieces.
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
    /// Nothing there yet.
    pub const fn new() -> Self {
        Self { bytes: [0; MAX_IMAGE_LEN] }
    }

    /// Handles a piece, a commit or a roll back: what to answer and, where the image in force may have changed, what it
    /// is now. `None` for every other message.
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
        // What flash holds counts, whatever the code says: a failed step may have changed it all the same.
        let changed = !matches!(message, Message::Piece { .. });
        let reply = Reply { to: message.kind(), code, sequence: sequence(&loaded) };
        Some((reply, changed.then_some(loaded)))
    }

    fn keep(&mut self, offset: usize, piece: &[u8]) -> ReplyCode {
        match self.bytes.get_mut(offset..).and_then(|rest| rest.get_mut(..piece.len())) {
            Some(room) => {
                room.copy_from_slice(piece);
                ReplyCode::Done
            }
            None => ReplyCode::ChunkReader,
        }
    }

    fn commit<F: NorFlash>(&mut self, len: usize, banks: &mut Banks<F>, gyro: &Gyro) -> ReplyCode {
        let Some(bytes) = self.bytes.get(..len) else { return ReplyCode::ChunkReader };
        match Image::decode(bytes) {
            Ok(image) => banks.store(gyro, &image).map_or_else(of_store, |()| ReplyCode::Done),
            Err(_) => ReplyCode::NotAnImage,
        }
    }
}

/// Number of the image in force, 0 for the defaults.
fn sequence(loaded: &Loaded) -> u32 {
    loaded.image.description().sequence
}

fn of_store<E>(error: StoreError<E>) -> ReplyCode {
    match error {
        StoreError::Unfit(_) => ReplyCode::Unfit,
        StoreError::NotNewer { .. } => ReplyCode::NotNewer,
        StoreError::NothingToGoBackTo => ReplyCode::NothingToGoBackTo,
        StoreError::NoSlotLeft | StoreError::CounterAtEnd | StoreError::ReadBack { .. } | StoreError::Flash(_) => {
            ReplyCode::Flash
        }
    }
}
