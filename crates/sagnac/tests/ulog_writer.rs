//! Writes PX4 ULog files for tests: header, flag bits, formats, subscriptions, data (ULog file format,
//! docs.px4.io).

/// A file being written.
pub(crate) struct ULogWriter(Vec<u8>);

impl ULogWriter {
    pub(crate) fn new() -> Self {
        let mut bytes = vec![0x55, 0x4c, 0x6f, 0x67, 0x01, 0x12, 0x35, 1];
        bytes.extend_from_slice(&0_u64.to_le_bytes());
        let mut log = Self(bytes);
        log.message(b'B', &[0; 40]);
        log
    }

    fn message(&mut self, kind: u8, payload: &[u8]) {
        self.0.extend_from_slice(&u16::try_from(payload.len()).unwrap().to_le_bytes());
        self.0.push(kind);
        self.0.extend_from_slice(payload);
    }

    /// `name:type field;type field;`
    pub(crate) fn format(&mut self, text: &str) {
        self.message(b'F', text.as_bytes());
    }

    pub(crate) fn subscribe(&mut self, topic: &str, id: u16, instance: u8) {
        let payload = [&[instance], &id.to_le_bytes()[..], topic.as_bytes()].concat();
        self.message(b'A', &payload);
    }

    /// Time in µs and floats, as the formats of these tests have them.
    pub(crate) fn data(&mut self, id: u16, time_us: u64, floats: &[f32]) {
        let floats: Vec<u8> = floats.iter().flat_map(|f| f.to_le_bytes()).collect();
        let payload = [&id.to_le_bytes()[..], &time_us.to_le_bytes(), &floats].concat();
        self.message(b'D', &payload);
    }

    pub(crate) fn finish(self) -> Vec<u8> {
        self.0
    }
}
