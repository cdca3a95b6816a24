//! Formats and subscriptions of a ULog file, and which of its topics are the gyro and the thermometers.

use std::collections::{BTreeMap, BTreeSet};

use crate::ingest::ulog::messages::Message;

/// Largest number of formats and subscriptions.
const MAX_KNOWN: usize = 4096;
/// Largest size of all formats together, bytes: PX4's own have about 200 kB.
const MAX_FORMAT_BYTES: usize = 4 << 20;
/// Topics that hold rates, the preferred one first, and their fields.
const GYROS: [(&str, [&str; 3]); 2] =
    [("sensor_gyro", ["x", "y", "z"]), ("sensor_combined", ["gyro_rad[0]", "gyro_rad[1]", "gyro_rad[2]"])];
pub(super) const TEMPERATURE: &str = "temperature";
/// Types a flat format may have.
const SCALARS: [&str; 12] = [
    "int8_t", "uint8_t", "int16_t", "uint16_t", "int32_t", "uint32_t", "int64_t", "uint64_t", "float", "double",
    "bool", "char",
];

/// Type and name of each field.
pub(super) type FlatFields = Vec<(String, String)>;

/// Name and fields of a flat format; `None` for a nested one.
fn flat_format(payload: &[u8]) -> Option<(String, FlatFields)> {
    let text = std::str::from_utf8(payload).ok()?;
    let (name, fields) = text.split_once(':')?;
    let fields = fields.split_terminator(';').map(|field| {
        let (kind, name) = field.split_once(' ')?;
        let scalar = kind.split_once('[').map_or(kind, |(scalar, _)| scalar);
        SCALARS.contains(&scalar).then(|| (kind.to_owned(), name.to_owned()))
    });
    Some((name.to_owned(), fields.collect::<Option<Vec<_>>>()?))
}

/// A topic that is read.
#[derive(Clone, Debug)]
pub(super) enum TopicUse {
    Gyro([&'static str; 3], bool),
    /// Index of the column.
    Thermometer(usize),
}

/// Formats and subscriptions of the file so far.
#[derive(Default)]
pub(super) struct Known {
    /// Each record itself, and the fields it names.
    pub(super) formats: BTreeMap<String, (Vec<u8>, FlatFields)>,
    /// Bytes of them.
    format_bytes: usize,
    /// Message id to topic, instance and the record itself.
    pub(super) subscribed: BTreeMap<u16, (String, u8, Vec<u8>)>,
}

impl Known {
    pub(super) fn learn(&mut self, message: &Message) {
        match message.kind {
            b'F' if self.formats.len() < MAX_KNOWN && self.format_bytes + message.payload.len() <= MAX_FORMAT_BYTES => {
                self.format_bytes += message.payload.len();
                if let Some((name, fields)) = flat_format(&message.payload) {
                    self.formats.insert(name, (message.payload.clone(), fields));
                }
            }
            b'A' if message.payload.len() > 3 && self.subscribed.len() < MAX_KNOWN => {
                let id = u16::from_le_bytes([message.payload[1], message.payload[2]]);
                if let Ok(topic) = std::str::from_utf8(&message.payload[3..])
                    && self.formats.contains_key(topic)
                {
                    let subscription = (topic.to_owned(), message.payload[0], message.payload.clone());
                    self.subscribed.entry(id).or_insert(subscription);
                }
            }
            _ => {}
        }
    }

    fn has_field(&self, topic: &str, field: &str) -> bool {
        let fields = self.formats.get(topic).map(|(_, fields)| fields.as_slice()).unwrap_or_default();
        fields.iter().any(|(kind, name)| name == field && kind == "float")
    }

    /// Gyros of an instance: message id, fields and whether it has a temperature of its own; the preferred one first.
    fn gyros(&self, instance: u8) -> impl Iterator<Item = (u16, TopicUse)> {
        GYROS.iter().flat_map(move |(topic, fields)| {
            let of_topic = self.subscribed.iter().filter(move |(_, (name, of, _))| name == topic && *of == instance);
            of_topic.map(move |(id, _)| (*id, TopicUse::Gyro(*fields, self.has_field(topic, TEMPERATURE))))
        })
    }

    /// The preferred gyro that is not silent.
    pub(super) fn gyro(&self, instance: u8, silent: &BTreeSet<u16>) -> Option<(u16, TopicUse)> {
        self.gyros(instance).find(|(id, _)| !silent.contains(id))
    }

    /// The gyros without data.
    pub(super) fn silent(&self, instance: u8, heard: &BTreeSet<u16>) -> BTreeSet<u16> {
        self.gyros(instance).map(|(id, _)| id).filter(|id| !heard.contains(id)).collect()
    }

    pub(super) fn is_thermometer(&self, id: u16) -> bool {
        self.subscribed.get(&id).is_some_and(|(topic, ..)| self.has_field(topic, TEMPERATURE))
    }

    /// Thermometers of other sensors: message id and name.
    pub(super) fn thermometers(&self, gyro: u16) -> Vec<(u16, String)> {
        let others = self.subscribed.iter().filter(|(id, (topic, of, _))| {
            **id != gyro && *of == 0 && !topic.contains("gyro") && self.has_field(topic, TEMPERATURE)
        });
        others.map(|(id, (topic, ..))| (*id, topic.trim_start_matches("sensor_").to_owned())).collect()
    }

    pub(super) fn topics(&self) -> String {
        let names: BTreeSet<&str> = self.subscribed.values().map(|(topic, ..)| topic.as_str()).collect();
        names.into_iter().collect::<Vec<_>>().join(", ")
    }
}
