//! The kinds of messages in the C header of the ports and on the page of the serial line, from the codec's own table.

use std::fmt::Write as _;
use std::fs;

use anyhow::Result;
use sagnac_board::{Direction, KINDS, MessageKind};
use xtask::shell::root;

use crate::made::{Made, between_marks, marks};
use crate::places::{FRAME_HEADER, SERIAL_LINE};

pub(crate) fn make() -> Result<Vec<Made>> {
    let of = |direction: Direction| KINDS.iter().filter(move |kind| kind.direction == direction);
    let mut header = String::from("/* Kinds of frames. From the gyro: */\n");
    of(Direction::FromGyro).try_for_each(|kind| define(&mut header, kind))?;
    header += "/* To the gyro: */\n";
    of(Direction::ToGyro).try_for_each(|kind| define(&mut header, kind))?;
    let begin = "/* Made by `cargo xtask bless serial-line`; do not edit. */\n".to_owned();
    let of_header = (begin, "/* End of the kinds. */\n".to_owned());
    let header = between_marks(&fs::read_to_string(root().join(FRAME_HEADER))?, &of_header, &header)?;
    let mut page = fs::read_to_string(root().join(SERIAL_LINE))?;
    let tables = [("from-gyro", Direction::FromGyro), ("to-gyro", Direction::ToGyro), ("to-rig", Direction::ToRig)];
    for (name, direction) in tables {
        let mut table = String::from("| kind | payload | |\n|---|---|---|\n");
        for kind in of(direction) {
            let [effect, number] = [
                kind.effect.trim().replace("[`sagnac_core::service_message`]", "`service_message`"),
                format!("{:02x}", kind.number),
            ];
            writeln!(table, "| {number} {} | {} | {effect} |", kind.label, kind.payload)?;
        }
        page = between_marks(&page, &marks(name, "serial-line"), &table)?;
    }
    Ok(vec![Made::new(FRAME_HEADER, header), Made::new(SERIAL_LINE, page)])
}

fn define(header: &mut String, kind: &MessageKind) -> Result<()> {
    Ok(writeln!(header, "#define SAGNAC_KIND_{} 0x{:02X}U", kind.name, kind.number)?)
}
