//! A new image over the serial line: pieces, then a commit; a confirmation; or a roll back to the image before.
//!
//! ```text
//! board without a key:   pieces ─▶ commit ─▶ decoded, for this gyro, newer ─▶ stored ─▶ in use between two ticks
//! board with a key:      service ─▶ challenge ─▶ answer ─▶ pieces ─▶ commit ─▶ signature ─▶ … as above
//! ```
//!
//! Pieces may arrive in any order and more than once. The commit decodes, checks and stores the image; the board starts
//! to use it between two ticks. A refused commit changes neither the active image nor the received pieces, so only
//! missing pieces need to be sent again.
//!
//! A board with a public key ([`Trust`]) takes nothing until its challenge is answered with a signature over the challenge, the change that
//! was asked for, and this gyro's serial number and axis. One answer opens the service mode for that change alone: a commit, a confirmation
//! or a roll back. When the change is done the mode ends, and so it does [`SERVICE_S`] after the challenge and at power-off. A wrong answer
//! needs another challenge. The image itself needs a signature too. Its counter is raised before its commit word is programmed: power that
//! fails in between leaves the old image, and the same upload can be sent again.
//!
//! A store erases and programs flash, and a signature takes milliseconds. Call it from the main loop, not from the tick. Pieces, challenges
//! and answers do not read the flash.

use embedded_storage::nor_flash::NorFlash;
use sagnac_core::{
    Banks, CHALLENGE_LEN, Gyro, Loaded, MAX_SIGNED_LEN, NoKey, SignatureError, StoreError, Trust, Trusted,
    service_message,
};

use crate::message::{Change, Commit, Message, Piece, Reply, ReplyCode};

/// From the challenge on the service mode lasts so long, s.
pub const SERVICE_S: u8 = 120;

/// Buffer for an image in pieces, and what the board trusts.
#[derive(Clone, Debug)]
pub struct Upload<T = NoKey> {
    bytes: [u8; MAX_SIGNED_LEN],
    trust: T,
    service: Service,
    service_seconds_left: u8,
    /// The last reply with what flash holds; `None` before the first one.
    last: Option<Reply>,
}

/// The service mode of a board with a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Service {
    Closed,
    /// A challenge was sent, and not answered yet.
    Asked(Change, [u8; CHALLENGE_LEN]),
    Open(Change),
}

/// What the board says to a message, and what flash holds now if the active image may have changed.
#[derive(Clone, Copy, Debug)]
pub struct Handled {
    /// A reply or a challenge.
    pub message: Message,
    /// Give it to the board between two ticks.
    pub loaded: Option<Loaded>,
}

impl<T: Trust> Upload<T> {
    /// An empty buffer.
    pub const fn new(trust: T) -> Self {
        Self { bytes: [0; MAX_SIGNED_LEN], trust, service: Service::Closed, service_seconds_left: 0, last: None }
    }

    /// What the board trusts.
    pub const fn trust(&self) -> &T {
        &self.trust
    }

    /// Power-on: the service mode is closed. The reply to send.
    pub const fn power_on(&mut self, loaded: &Loaded) -> Reply {
        self.service = Service::Closed;
        let reply = Reply::at_power_on(loaded);
        self.last = Some(reply);
        reply
    }

    /// A second has passed: call it once a second. The service mode ends by itself.
    pub const fn second(&mut self) {
        self.service_seconds_left = self.service_seconds_left.saturating_sub(1);
        if self.service_seconds_left == 0 {
            self.service = Service::Closed;
        }
    }

    /// Handles a message about images. `None` for every other one.
    pub fn handle<F: NorFlash>(&mut self, message: &Message, banks: &mut Banks<F>, gyro: &Gyro) -> Option<Handled> {
        let change = Change::of(message);
        let open =
            self.trust.public_key().is_none() || change.is_some_and(|change| self.service == Service::Open(change));
        let code = match message {
            Message::Service(change) if self.trust.public_key().is_some() => {
                let challenge = self.trust.challenge();
                (self.service, self.service_seconds_left) = (Service::Asked(*change, challenge), SERVICE_S);
                return Some(Handled { message: Message::Challenge(challenge), loaded: None });
            }
            // Nothing to answer: the line is open.
            Message::Service(_) => ReplyCode::Done,
            Message::Answer(signature) => self.answer(signature, gyro),
            Message::Piece(_) | Message::Commit(_) | Message::Confirm | Message::RollBack if !open => ReplyCode::Locked,
            Message::Piece(Piece { offset, len, bytes }) => {
                self.keep(usize::from(*offset), bytes.get(..usize::from(*len))?)
            }
            Message::Commit(Commit { len, trial }) => self.commit(usize::from(*len), *trial, banks, gyro),
            Message::Confirm => banks.confirm(gyro).map_or_else(of_store, |()| ReplyCode::Done),
            Message::RollBack => banks.roll_back(gyro).map_or_else(of_store, |_| ReplyCode::Done),
            _ => return None,
        };
        let changes = open && matches!(message, Message::Commit(_) | Message::Confirm | Message::RollBack);
        if changes && code == ReplyCode::Done {
            self.service = Service::Closed;
        }
        // Use what flash holds, not the code: a failed step may still have changed the active image.
        let loaded = (changes || self.last.is_none()).then(|| banks.load(gyro));
        let held = loaded.as_ref().map(Reply::at_power_on).or(self.last)?;
        self.last = Some(held);
        let reply = Reply { to: message.kind(), code, ..held };
        Some(Handled { message: Message::Reply(reply), loaded: loaded.filter(|_| changes) })
    }

    fn answer(&mut self, signature: &[u8; 64], gyro: &Gyro) -> ReplyCode {
        let (Some(key), Service::Asked(change, challenge)) = (self.trust.public_key(), self.service) else {
            return ReplyCode::Locked;
        };
        let message = service_message(&gyro.serial, gyro.axis, change as u8, &challenge);
        let right = self.trust.verify(&key, message.bytes(), signature);
        self.service = if right { Service::Open(change) } else { Service::Closed };
        if right { ReplyCode::Done } else { ReplyCode::BadSignature }
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

    #[inline(never)]
    fn commit<F: NorFlash>(&mut self, len: usize, trial: bool, banks: &mut Banks<F>, gyro: &Gyro) -> ReplyCode {
        let Some(bytes) = self.bytes.get(..len) else { return ReplyCode::BadPiece };
        let Trusted { image, counter } = match Trusted::check(bytes, &self.trust) {
            Ok(trusted) => trusted,
            Err(error) => return of_signature(error),
        };
        if let Err(error) = banks.check(gyro, &image) {
            return of_store(error);
        }
        if let Some(counter) = counter.filter(|counter| *counter > self.trust.lowest_counter()) {
            self.trust.raise_lowest_counter(counter);
        }
        let stored = if trial { banks.store_on_trial(gyro, &image) } else { banks.store(gyro, &image) };
        stored.map_or_else(of_store, |()| ReplyCode::Done)
    }
}

const fn of_signature(error: SignatureError) -> ReplyCode {
    match error {
        SignatureError::Unsigned => ReplyCode::Unsigned,
        SignatureError::Block | SignatureError::OtherKey | SignatureError::Signature => ReplyCode::BadSignature,
        SignatureError::Model => ReplyCode::Mismatch,
        SignatureError::OldCounter { .. } => ReplyCode::NotNewer,
        SignatureError::Image(_) => ReplyCode::NotAnImage,
    }
}

fn of_store<E>(error: StoreError<E>) -> ReplyCode {
    match error {
        StoreError::Mismatch(_) => ReplyCode::Mismatch,
        StoreError::NotNewer { .. } => ReplyCode::NotNewer,
        StoreError::NoOlderImage => ReplyCode::NoOlderImage,
        StoreError::NotOnTrial => ReplyCode::NotOnTrial,
        StoreError::OnTrial => ReplyCode::OnTrial,
        StoreError::NoFreeNote | StoreError::ReadBack { .. } | StoreError::Flash(_) => ReplyCode::Flash,
    }
}
