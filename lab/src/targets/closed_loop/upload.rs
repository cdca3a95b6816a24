//! An image over the target's line, while it runs: refused where it is broken or its line is cut, else on trial and confirmed.

use anyhow::{Context, Result, ensure};
use sagnac_board::frame::FrameReader;
use sagnac_board::{Message, OutputFrame, Reply, ReplyCode, Row};
use sagnac_core::Origin;

use super::target::{BoardInQemu, bytes_of};

/// Bytes of a piece of an image.
const PIECE: usize = 60;

/// An upload as `sagnac export --to upload` makes it.
pub(super) struct Pieces {
    pieces: Vec<Message>,
    commit: Message,
}

impl Pieces {
    /// The messages of a file.
    pub(super) fn read(bytes: &[u8]) -> Result<Self> {
        let mut reader = FrameReader::new();
        let frames = bytes.iter().filter_map(|byte| reader.push(*byte));
        let mut pieces: Vec<Message> = frames.filter_map(|frame| Message::parse(&frame)).collect();
        let commit = pieces.pop().context("an upload without a message")?;
        ensure!(matches!(commit, Message::Commit(_)), "an upload that does not end with its commit: {commit:?}");
        ensure!(pieces.len() > 3, "an upload of {} pieces cannot be cut in its middle", pieces.len());
        Ok(Self { pieces, commit })
    }

    /// The same with one bit of the image turned over, behind its middle.
    fn broken(&self, image: &[u8]) -> Vec<Message> {
        let mut image = image.to_vec();
        let at = self.cut_at() * PIECE + PIECE + PIECE / 2;
        image.iter_mut().skip(at).take(1).for_each(|byte| *byte ^= 4);
        Message::pieces(&image).collect()
    }

    /// Number of the piece in which the line is cut.
    fn cut_at(&self) -> usize {
        self.pieces.len() / 2
    }
}

/// The image that is to stay in force, and the row in which the target runs meanwhile.
pub(super) struct Old {
    /// Its sequence number.
    pub(super) sequence: u32,
    /// The chamber at rest.
    pub(super) soak: Row,
}

impl Old {
    /// Sends the whole upload; the answer to its commit.
    pub(super) fn send(&self, target: &mut BoardInQemu, upload: &Pieces) -> Result<Reply> {
        self.pieces(target, &upload.pieces)?;
        target.ask(&upload.commit, &self.soak)
    }

    fn pieces(&self, target: &mut BoardInQemu, pieces: &[Message]) -> Result<()> {
        for piece in pieces {
            let reply = target.ask(piece, &self.soak)?;
            ensure!(reply.code == ReplyCode::Done, "a piece is refused: {reply:?}");
        }
        Ok(())
    }

    /// An image with one bit turned over is refused.
    pub(super) fn survives_a_broken_image(
        &self,
        target: &mut BoardInQemu,
        upload: &Pieces,
        image: &[u8],
    ) -> Result<()> {
        let broken = upload.broken(image);
        ensure!(broken.iter().zip(&upload.pieces).filter(|(a, b)| a != b).count() == 1, "no piece is broken");
        self.pieces(target, &broken)?;
        self.stays(target, &upload.commit)?;
        println!("check: an image of which one bit is turned over is refused, and image {} stays", self.sequence);
        Ok(())
    }

    /// A line that is cut within a piece in the middle of the upload leaves the old image; so does a piece that is damaged on the line.
    pub(super) fn survives_a_cut_line(&self, target: &mut BoardInQemu, upload: &Pieces) -> Result<()> {
        let (before, after) = upload.pieces.split_at(upload.cut_at());
        let cut = bytes_of(after.first().context("a piece in the middle")?)?;
        self.pieces(target, before)?;
        target.cut_behind(cut.get(..cut.len() / 2).unwrap_or(&[]), &self.soak)?;
        self.stays(target, &upload.commit)?;
        let lost = lost(&target.outputs);
        println!(
            "check: the line is cut within piece {} of {} while ticks run (frames lost: {lost}): image {} stays",
            upload.cut_at() + 1,
            upload.pieces.len(),
            self.sequence
        );
        self.survives_a_damaged_piece(target, upload, after)
    }

    fn survives_a_damaged_piece(&self, target: &mut BoardInQemu, upload: &Pieces, rest: &[Message]) -> Result<()> {
        for (at, piece) in rest.iter().enumerate() {
            if at == 1 {
                let mut damaged = bytes_of(piece)?;
                let middle = damaged.len() / 2;
                damaged.iter_mut().skip(middle).take(1).for_each(|byte| *byte ^= 1);
                // Nothing answers it: it is no frame.
                target.say(&damaged, &self.soak)?;
            } else {
                self.pieces(target, std::slice::from_ref(piece))?;
            }
        }
        self.stays(target, &upload.commit)?;
        println!("check: the rest of the upload, one of its pieces damaged on the line: image {} stays", self.sequence);
        Ok(())
    }

    /// The commit is refused as of no image, and answer and frames say that the old image is in force.
    fn stays(&self, target: &mut BoardInQemu, commit: &Message) -> Result<()> {
        let refused = target.ask(commit, &self.soak)?;
        let expected = Reply {
            to: commit.kind(),
            code: ReplyCode::NotAnImage,
            sequence: self.sequence,
            origin: Origin::Newest,
            trial: false,
        };
        ensure!(refused == expected, "a broken upload is answered with {refused:?}");
        self.frames_say(target, false)
    }

    /// A frame that began after now says that an intact image runs, and whether on trial.
    pub(super) fn frames_say(&self, target: &mut BoardInQemu, trial: bool) -> Result<()> {
        target.idle()?;
        target.run(&[self.soak, self.soak])?;
        let newest = target.outputs.last().context("no frame")?;
        let right = newest.origin == Origin::Newest && newest.trial == trial;
        ensure!(right, "an intact image is due, on trial: {trial}, and the frame is {newest:?}");
        Ok(())
    }
}

/// Frames that are missing between others.
pub(super) fn lost(outputs: &[OutputFrame]) -> u32 {
    let gap = |pair: &[OutputFrame]| match pair {
        [a, b] => u32::from(b.sequence.wrapping_sub(a.sequence).wrapping_sub(1)),
        _ => 0,
    };
    outputs.windows(2).map(gap).sum()
}

#[cfg(test)]
mod tests {
    use sagnac_board::Commit;

    use super::*;

    fn upload(image: &[u8]) -> Pieces {
        let messages = Message::pieces(image).chain([Message::Commit(Commit { len: image.len() as u16, trial: true })]);
        let bytes: Vec<u8> = messages.flat_map(|message| bytes_of(&message).unwrap()).collect();
        Pieces::read(&bytes).unwrap()
    }

    #[test]
    fn a_broken_upload_differs_in_a_piece_behind_the_cut() {
        let image: Vec<u8> = (0..244).collect();
        let whole = upload(&image);
        let broken = whole.broken(&image);
        let differs: Vec<usize> =
            broken.iter().zip(&whole.pieces).enumerate().filter(|(_, (a, b))| a != b).map(|(at, _)| at).collect();
        assert_eq!((differs, whole.cut_at()), (vec![3], 2));
    }

    #[test]
    fn an_upload_ends_with_its_commit() {
        let pieces: Vec<u8> = Message::pieces(&[7; 244]).flat_map(|piece| bytes_of(&piece).unwrap()).collect();
        assert!(Pieces::read(&pieces).is_err());
    }

    #[test]
    fn lost_frames_are_counted_over_the_end_of_their_numbers() {
        let frames = [65_534, 65_535, 2, 3].map(|sequence| OutputFrame { sequence, ..OutputFrame::default() });
        assert_eq!(lost(&frames), 2);
    }
}
