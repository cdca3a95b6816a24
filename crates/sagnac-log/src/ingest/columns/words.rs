//! One header as people write it: `Gyro X (deg/s)` is a rate about x in °/s, `Chip temp [°C]` a temperature named chip.
//!
//! ```text
//! header ─▶ words, units in brackets ─▶ quantities that the words name ─▶ the one that has the stated unit, else the first ─▶ axis or name
//! ```
//!
//! Words are English, German, French and Spanish. `GyroX`, `xgyro`, `gx`, `gyro[x]` and `gyroADC[0]` end in an axis like `gyro_x`.
//!
//! Fails where a name of one letter has two meanings: `gx` without a unit may be an acceleration, so [`Named::is_letter`] marks it.

use crate::setup::RATE_UNITS;

/// Words for a time.
const TIME: [&str; 18] = [
    "time",
    "zeit",
    "temps",
    "tiempo",
    "timestamp",
    "elapsed",
    "clock",
    "datetime",
    "date",
    "datum",
    "zeitpunkt",
    "zeitstempel",
    "uhrzeit",
    "aufnahme",
    "horodatage",
    "fecha",
    "millis",
    "micros",
];
/// Words for a thermometer.
const TEMPERATURE: [&str; 10] =
    ["temperature", "temp", "temperatur", "température", "temperatura", "tmp", "thermo", "thermometer", "rtd", "pt100"];
/// Words for counts.
const COUNTS: [&str; 17] = [
    "counts",
    "count",
    "cnt",
    "cnts",
    "pulses",
    "pulse",
    "puls",
    "impulse",
    "fringes",
    "fringe",
    "impulsions",
    "pulsos",
    "counter",
    "zähler",
    "zaehler",
    "compteur",
    "contador",
];
/// Words for a rate.
const RATE: [&str; 22] = [
    "rate",
    "gyro",
    "gyr",
    "gyros",
    "gyroscope",
    "omega",
    "angrate",
    "angvel",
    "drehrate",
    "drehraten",
    "winkelrate",
    "winkelgeschwindigkeit",
    "drehgeschwindigkeit",
    "gyroskop",
    "kreisel",
    "vitesse",
    "gyromètre",
    "gyrometre",
    "gyroscopio",
    "giroscopio",
    "giro",
    "velocidad",
];
/// The two words of an angular velocity.
const ANGULAR: [&str; 2] = ["angular", "ang"];
const VELOCITY: [&str; 3] = ["velocity", "vel", "speed"];
/// Words that make a rate one of a table, a command, another sensor or an estimate.
const NO_GYRO: [&str; 22] = [
    "table",
    "tisch",
    "reference",
    "ref",
    "input",
    "command",
    "cmd",
    "target",
    "setpoint",
    "sample",
    "sampling",
    "frame",
    "baud",
    "data",
    "acc",
    "accel",
    "acceleration",
    "bias",
    "sigma",
    "std",
    "covariance",
    "temp",
];
/// Words that make a counter one of rows.
const NO_COUNTS: [&str; 9] = ["packet", "sample", "frame", "row", "line", "msg", "message", "seq", "index"];
/// Letters of axes.
const AXES: [&str; 3] = ["x", "y", "z"];
/// Turns about them.
const TURNS: [&str; 3] = ["roll", "pitch", "yaw"];

/// Units as people write them, and the ending of Sagnac's header.
pub(crate) type UnitSpellings = [(&'static [&'static str], &'static str)];
const TIME_UNITS: &UnitSpellings = &[
    (&["s", "sec", "secs", "second", "seconds", "sek", "sekunden", "secondes", "segundos"], "s"),
    (&["ms", "msec", "millisecond", "milliseconds", "millis", "millisekunden"], "ms"),
    (&["us", "µs", "μs", "usec", "microsecond", "microseconds", "micros"], "us"),
    (&["ns", "nsec", "nanosecond", "nanoseconds"], "ns"),
];
const TEMPERATURE_UNITS: &UnitSpellings = &[
    (
        &[
            "c",
            "°c",
            "c°",
            "degc",
            "deg c",
            "deg. c",
            "celsius",
            "grad c",
            "grad celsius",
            "°celsius",
            "deg celsius",
            "degree c",
            "degree celsius",
            "degrees c",
            "degrees celsius",
        ],
        "c",
    ),
    (&["k", "°k", "kelvin", "degk"], "k"),
];
const COUNT_UNITS: &UnitSpellings = &[(&["counts", "count", "cts", "pulses", "pulse", "1", "-", ""], "")];

/// Quantities of columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeaderQuantity {
    /// A time.
    Time,
    /// A thermometer.
    Temperature,
    /// Counts of an axis.
    Counts,
    /// A rate about an axis.
    Rate,
}

impl HeaderQuantity {
    /// In the order in which a header of several is read.
    pub(crate) const ALL: [Self; 4] = [Self::Time, Self::Temperature, Self::Counts, Self::Rate];

    /// The first word of Sagnac's header.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Temperature => "temperature",
            Self::Counts => "counts",
            Self::Rate => "rate",
        }
    }

    /// Its units.
    pub(crate) fn units(self) -> &'static UnitSpellings {
        match self {
            Self::Time => TIME_UNITS,
            Self::Temperature => TEMPERATURE_UNITS,
            Self::Counts => COUNT_UNITS,
            Self::Rate => RATE_UNITS,
        }
    }

    /// The ending of Sagnac's header for one of its units.
    pub(crate) fn ending_of(self, unit: &str) -> Option<&'static str> {
        let unit = bare(unit);
        self.units().iter().find(|(names, _)| names.contains(&unit.as_str())).map(|(_, ending)| *ending)
    }

    fn is_named_by(self, words: &[String]) -> bool {
        let has = |names: &[&str]| words.iter().any(|word| names.contains(&word.as_str()));
        match self {
            Self::Time => has(&TIME),
            Self::Temperature => has(&TEMPERATURE),
            Self::Counts => has(&COUNTS) && !has(&NO_COUNTS),
            Self::Rate => (has(&RATE) || has(&ANGULAR) && has(&VELOCITY)) && !has(&NO_GYRO),
        }
    }
}

/// The unit of a header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HeaderUnit {
    /// The ending of Sagnac's header.
    Known(&'static str),
    /// A unit that Sagnac does not read.
    Unread(String),
    /// None is stated.
    Open,
}

/// A header, understood.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    /// Its quantity.
    pub quantity: HeaderQuantity,
    /// Its unit.
    pub unit: HeaderUnit,
    /// Axis or thermometer as the ending `_x`; empty where there is none.
    pub place: String,
    /// Its words.
    pub words: Vec<String>,
    /// One letter names the quantity: `gx`, `wx`, `T`.
    pub is_letter: bool,
    /// The unit that names the quantity, where no word does.
    pub by_unit: Option<String>,
}

impl Named {
    /// A header with its unit from a line of units, if there is one; `None` where neither words nor unit name a quantity.
    pub fn of(header: &str, unit: Option<&str>) -> Option<Self> {
        let (mut words, mut groups) = parts_of(header);
        let unit = unit.map(str::to_owned).or_else(|| unit_of(&mut groups, &words));
        words.extend(groups.iter().flat_map(|group| words_of(index(group).unwrap_or(group))));
        let stated = |quantity: HeaderQuantity| stated(quantity, unit.as_deref(), &words);
        let is_known = |quantity: &HeaderQuantity| matches!(stated(*quantity), HeaderUnit::Known(_));
        let named = || HeaderQuantity::ALL.into_iter().filter(|quantity| quantity.is_named_by(&words));
        let letter = || by_letter(&words, is_known(&HeaderQuantity::Time), is_known(&HeaderQuantity::Rate));
        let unit_text = unit.as_deref().or_else(|| behind_blank(header));
        let by_unit = unit_text.and_then(of_unit);
        // `Kreisel [Impulse]` has counts; a unit that nobody knows leaves the word as it is.
        let is_of_counts = by_unit == Some((HeaderQuantity::Counts, ""));
        let by_word = named().find(is_known).or_else(|| named().next().filter(|_| !is_of_counts));
        let by_letter = if by_word.is_none() { letter() } else { None };
        let (quantity, unit) = match by_word.or(by_letter) {
            Some(quantity) => (quantity, stated(quantity)),
            None => by_unit.map(|(quantity, ending)| (quantity, HeaderUnit::Known(ending)))?,
        };
        let place = match quantity {
            HeaderQuantity::Time => String::new(),
            HeaderQuantity::Temperature => thermometer_of(&words),
            HeaderQuantity::Counts | HeaderQuantity::Rate => axis_of(&words),
        };
        let by_unit = unit_text.filter(|_| by_word.or(by_letter).is_none()).map(str::to_owned);
        Some(Self { quantity, unit, place, is_letter: by_letter.is_some(), by_unit, words })
    }

    /// Sagnac's header in a unit.
    pub fn role(&self, ending: &str) -> String {
        let parts = [self.quantity.word(), ending, self.place.trim_start_matches('_')];
        parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("_")
    }

    /// True where the first word is Sagnac's own.
    pub(crate) fn is_own(&self) -> bool {
        self.words.first().is_some_and(|word| word == self.quantity.word())
    }
}

/// A unit as it is compared: in small letters, without brackets, each spelling of a ratio as `deg/s`.
pub(crate) fn bare(unit: &str) -> String {
    let lower = unit.to_lowercase().replace(['º', '˚'], "°").replace('℃', "°c").replace("⁻¹", "^-1");
    let words: Vec<&str> = lower.trim_matches(['[', ']', '(', ')']).split_whitespace().collect();
    // One logger writes `deg/s sign`.
    let words = words.strip_suffix(&["sign"]).unwrap_or(&words);
    let text = words.join(" ");
    let inverse = text.strip_suffix("^-1").or_else(|| text.strip_suffix("-1"));
    let inverse = inverse.and_then(|text| text.rsplit_once([' ', '.', '·', '*']));
    let Some((angle, time)) = inverse.or_else(|| text.split_once('/')).or_else(|| text.split_once(" per ")) else {
        return text;
    };
    let angle = match angle.trim() {
        "°" | "degree" | "degrees" | "deg." => "deg",
        "m°" | "millidegree" | "millidegrees" | "millideg" => "mdeg",
        "radian" | "radians" => "rad",
        angle => angle,
    };
    let time = match time.trim() {
        "sec" | "secs" | "second" | "seconds" => "s",
        "hr" | "hrs" | "hour" | "hours" => "h",
        time => time,
    };
    format!("{angle}/{time}")
}

/// The quantity that a unit alone names, and its ending; seconds and one letter say too little.
fn of_unit(unit: &str) -> Option<(HeaderQuantity, &'static str)> {
    let of = |quantity: HeaderQuantity| Some((quantity, quantity.ending_of(unit)?));
    let is_count = COUNTS.contains(&unit.to_lowercase().as_str());
    let known = of(HeaderQuantity::Temperature).or_else(|| of(HeaderQuantity::Rate));
    known.or_else(|| is_count.then_some((HeaderQuantity::Counts, ""))).filter(|_| unit.chars().count() > 1)
}

/// The words of a header outside of its brackets, and the text of each bracket.
fn parts_of(header: &str) -> (Vec<String>, Vec<String>) {
    let (mut words, mut groups) = (Vec::new(), Vec::new());
    for part in header.split_inclusive([')', ']']) {
        let (name, group) = part.split_once(['(', '[']).unwrap_or((part, ""));
        words.extend(words_of(name));
        groups.push(group.trim_end_matches([')', ']']).trim().to_owned());
    }
    groups.retain(|group| !group.is_empty());
    (words, groups)
}

/// The unit among the brackets, which is taken out of them: a known one, else the last that is no axis. The 1 of counts is a unit.
fn unit_of(groups: &mut Vec<String>, words: &[String]) -> Option<String> {
    let is_of_counts = HeaderQuantity::Counts.is_named_by(words);
    let is_axis =
        |group: &&String| AXES.contains(&group.to_lowercase().as_str()) || index(group).is_some() && !is_of_counts;
    let is_known = |group: &String| HeaderQuantity::ALL.iter().any(|quantity| quantity.ending_of(group).is_some());
    let at = groups.iter().position(|group| !is_axis(&group) && is_known(group));
    let at = at.or_else(|| groups.iter().rposition(|group| !is_axis(&group)))?;
    Some(groups.remove(at))
}

/// The axis of a number in brackets.
fn index(group: &str) -> Option<&'static str> {
    group.parse::<usize>().ok().and_then(|at| AXES.get(at)).copied()
}

/// The words of a text in small letters.
fn words_of(text: &str) -> Vec<String> {
    let tokens = text.split(|c: char| !c.is_alphanumeric() && c != '°').filter(|token| !token.is_empty());
    tokens.flat_map(words_in).collect()
}

/// One word, or those that are written together: `GyroX`, `xgyro`, `ChipTemp`, `temp1`.
fn words_in(token: &str) -> Vec<String> {
    let whole = vec![token.to_lowercase()];
    let is_quantity = |words: &[String]| {
        let is_of = |quantity: HeaderQuantity| quantity.is_named_by(words);
        is_of(HeaderQuantity::Temperature)
            || is_of(HeaderQuantity::Rate)
            || HeaderQuantity::Time.is_named_by(&words[..1])
    };
    if is_quantity(&whole) || HeaderQuantity::ALL.iter().any(|quantity| quantity.ending_of(token).is_some()) {
        return whole;
    }
    let mut parts: Vec<String> = Vec::new();
    let mut before = None;
    for letter in token.chars() {
        let is_new = before.is_none_or(|before: char| before.is_lowercase() && letter.is_uppercase());
        if is_new {
            parts.push(String::new());
        }
        parts.iter_mut().last().into_iter().for_each(|part| part.extend(letter.to_lowercase()));
        before = Some(letter);
    }
    let parts: Vec<String> = parts.iter().flat_map(|part| apart(part)).collect();
    if is_quantity(&parts) { parts } else { whole }
}

/// A rate with its axis written to it, or a thermometer with its number.
fn apart(word: &str) -> Vec<String> {
    let digits = word.trim_end_matches(|c: char| c.is_ascii_digit());
    let axis = AXES.iter().find_map(|axis| {
        let behind = word.strip_suffix(axis).map(|rest| (rest, *axis));
        behind.or_else(|| word.strip_prefix(axis).map(|rest| (rest, *axis))).filter(|(rest, _)| RATE.contains(rest))
    });
    match axis {
        Some((rate, axis)) => vec![rate.to_owned(), axis.to_owned()],
        None if TEMPERATURE.contains(&digits) && digits.len() < word.len() => {
            vec![digits.to_owned(), word[digits.len()..].to_owned()]
        }
        None => vec![word.to_owned()],
    }
}

/// The unit of a quantity: from brackets or a line of units, else from the words behind the first, also two of them: `rad_s`.
fn stated(quantity: HeaderQuantity, unit: Option<&str>, words: &[String]) -> HeaderUnit {
    // A stated unit that is not known is not overruled by a word of the name.
    if let Some(unit) = unit {
        return quantity.ending_of(unit).map_or(HeaderUnit::Unread(unit.to_owned()), HeaderUnit::Known);
    }
    if quantity == HeaderQuantity::Counts {
        return HeaderUnit::Open;
    }
    let one = words.iter().enumerate().filter(|(at, word)| *at > 0 || word.len() > 4).map(|(_, word)| word.clone());
    let two = words.windows(2).skip(1).map(|pair| format!("{}/{}", pair[0], pair[1]));
    let three = words.windows(3).skip(1).filter(|words| words[1] == "per");
    let three = three.map(|words| format!("{}/{}", words[0], words[2]));
    one.chain(two).chain(three).find_map(|unit| quantity.ending_of(&unit)).map_or(HeaderUnit::Open, HeaderUnit::Known)
}

/// The quantity that one letter names: `t` a time with a unit of times and else a temperature; `gx`, `wx` and `w` with an axis a rate. A
/// `gx` may be an acceleration where no unit says otherwise.
fn by_letter(words: &[String], is_time: bool, is_rate: bool) -> Option<HeaderQuantity> {
    let first = words.first()?.as_str();
    if first == "t" {
        return Some(if is_time { HeaderQuantity::Time } else { HeaderQuantity::Temperature });
    }
    let is_glued = |word: &String| word.strip_prefix(['g', 'w', 'ω']).is_some_and(|axis| AXES.contains(&axis));
    let is_apart = ["w", "ω"].contains(&first) && words.iter().any(|word| AXES.contains(&word.as_str()));
    let is_turn = is_rate && words.iter().any(|word| TURNS.contains(&word.as_str()));
    let is_gyro = words.iter().any(is_glued) || is_apart || is_turn;
    (is_gyro && !words.iter().any(|word| NO_GYRO.contains(&word.as_str()))).then_some(HeaderQuantity::Rate)
}

/// The axis among the words: a letter, else one that is glued to `g` or `w`, else a turn.
fn axis_of(words: &[String]) -> String {
    let letter = words.iter().map(String::as_str).find(|word| AXES.contains(word));
    let glued = || {
        let mut axes = words.iter().filter_map(|word| word.strip_prefix(['g', 'w', 'ω']));
        axes.find(|axis| AXES.contains(axis))
    };
    let turn = || words.iter().find_map(|word| Some(AXES[TURNS.iter().position(|turn| turn == word)?]));
    let axis = letter.or_else(glued).or_else(turn);
    axis.map_or(String::new(), |axis| format!("_{axis}"))
}

/// The name of a thermometer: the words that are neither a quantity nor a unit, as the ending `_chamber`.
fn thermometer_of(words: &[String]) -> String {
    let is_own = words.first().is_some_and(|word| word == HeaderQuantity::Temperature.word());
    let words = if is_own { &words[1..] } else { words };
    let is_plain = |word: &&String| {
        word.as_str() != "t"
            && (is_own || !TEMPERATURE.contains(&word.as_str()))
            && !["deg", "degree", "degrees"].contains(&word.as_str())
            && HeaderQuantity::Temperature.ending_of(word).is_none()
    };
    let name: Vec<&str> = words.iter().filter(is_plain).map(String::as_str).collect();
    if name.is_empty() { String::new() } else { format!("_{}", name.join("_")) }
}

/// The last word of a header, which may be a unit: `Chamber °C`. One letter alone names a channel as often.
fn behind_blank(header: &str) -> Option<&str> {
    let (_, last) = header.trim_end().rsplit_once(char::is_whitespace)?;
    (last.chars().count() > 1).then_some(last)
}

#[cfg(test)]
mod tests {
    use super::*;
    use HeaderQuantity::{Counts, Rate, Temperature, Time};

    /// A header, its quantity, its unit (`?` for none, `!` for one that is not read), and its axis or thermometer.
    const SPELLINGS: [(&str, HeaderQuantity, &str, &str); 104] = [
        ("gx", Rate, "?", "_x"),
        ("wy", Rate, "?", "_y"),
        ("ωz", Rate, "?", "_z"),
        ("w_z", Rate, "?", "_z"),
        ("imu_gx_dps", Rate, "dps", "_x"),
        ("gx_dps", Rate, "dps", "_x"),
        ("gz (deg/s)", Rate, "dps", "_z"),
        ("GyroX", Rate, "?", "_x"),
        ("GyroX (deg/h)", Rate, "dph", "_x"),
        ("GyroY_dps", Rate, "dps", "_y"),
        ("GyroZ (deg/s)", Rate, "dps", "_z"),
        ("GYRO_Z", Rate, "?", "_z"),
        ("GYROZ [rad/s]", Rate, "radps", "_z"),
        ("gyrox", Rate, "?", "_x"),
        ("xgyro", Rate, "?", "_x"),
        ("zgyro [mdps]", Rate, "mdps", "_z"),
        ("Z Gyro", Rate, "?", "_z"),
        ("gyr_x [deg/s]", Rate, "dps", "_x"),
        ("Gyr_Y", Rate, "?", "_y"),
        ("gyrX [deg/s sign]", Rate, "dps", "_x"),
        ("Gyro X [mdps]", Rate, "mdps", "_x"),
        ("Gyro X (m°/s)", Rate, "mdps", "_x"),
        ("angular_velocity.x", Rate, "?", "_x"),
        ("angular_velocity.y [rad/s]", Rate, "radps", "_y"),
        ("AngularVelocityZ", Rate, "?", "_z"),
        ("ang_vel_x", Rate, "?", "_x"),
        ("angvel_y_radps", Rate, "radps", "_y"),
        ("Angular rate Z (°/s)", Rate, "dps", "_z"),
        ("gyroADC[0]", Rate, "?", "_x"),
        ("gyroADC[1]", Rate, "?", "_y"),
        ("gyroADC[2] (deg/s)", Rate, "dps", "_z"),
        ("gyro[z]", Rate, "?", "_z"),
        ("gyro(y) [deg/s]", Rate, "dps", "_y"),
        ("Gyroscope X", Rate, "?", "_x"),
        ("Gyroscope Y (rad/s)", Rate, "radps", "_y"),
        ("A_Gyro_X_CAL", Rate, "?", "_x"),
        ("imu.gyro.z [deg s^-1]", Rate, "dps", "_z"),
        ("w_RS_S_x [rad s^-1]", Rate, "radps", "_x"),
        ("w_RS_S_z [rad·s⁻¹]", Rate, "radps", "_z"),
        ("omega_y [rad.s-1]", Rate, "radps", "_y"),
        ("Ω_x (rad/sec)", Rate, "radps", "_x"),
        ("gyro_x_rad_s", Rate, "radps", "_x"),
        ("gyro_y_deg_per_s", Rate, "dps", "_y"),
        ("gyro z degrees per second", Rate, "dps", "_z"),
        ("Gyro Z (degrees per second)", Rate, "dps", "_z"),
        ("Gyro Z (Degrees/Second)", Rate, "dps", "_z"),
        ("Gyro Z (degree/hour)", Rate, "dph", "_z"),
        ("Gyro Z (deg/hr)", Rate, "dph", "_z"),
        ("gyro_x [mrad/s]", Rate, "!", "_x"),
        ("gyro_x [LSB]", Rate, "!", "_x"),
        ("Drehrate z [°/h]", Rate, "dph", "_z"),
        ("Drehrate-Y (°/s)", Rate, "dps", "_y"),
        ("Winkelgeschwindigkeit X [rad/s]", Rate, "radps", "_x"),
        ("Kreisel Z", Rate, "?", "_z"),
        ("Vitesse X (°/s)", Rate, "dps", "_x"),
        ("gyromètre y", Rate, "?", "_y"),
        ("giroscopio z (deg/s)", Rate, "dps", "_z"),
        ("Roll rate (deg/s)", Rate, "dps", "_x"),
        ("pitch_rate_dps", Rate, "dps", "_y"),
        ("Yaw rate", Rate, "?", "_z"),
        ("Rate", Rate, "?", ""),
        ("rate x", Rate, "?", "_x"),
        ("T", Temperature, "?", ""),
        ("T [K]", Temperature, "k", ""),
        ("t_s", Time, "s", ""),
        ("t [ms]", Time, "ms", ""),
        ("Temp", Temperature, "?", ""),
        ("tempC", Temperature, "c", ""),
        ("temp_degC", Temperature, "c", ""),
        ("TempK", Temperature, "k", ""),
        ("ChipTemp [°C]", Temperature, "c", "_chip"),
        ("Chip temp [ºC]", Temperature, "c", "_chip"),
        ("chip_temp_deg_c", Temperature, "c", "_chip"),
        ("A_Temperature_CAL (Degrees Celsius)", Temperature, "c", "_a_cal"),
        ("Temperature (deg C)", Temperature, "c", ""),
        ("Temperature block (℃)", Temperature, "c", "_block"),
        ("Temperatur Kammer [Grad C]", Temperature, "c", "_kammer"),
        ("Température [Kelvin]", Temperature, "k", ""),
        ("Temp (chamber) [°C]", Temperature, "c", "_chamber"),
        ("Temp [F]", Temperature, "!", ""),
        ("temp1 [C]", Temperature, "c", "_1"),
        ("Gyro temp [°C]", Temperature, "c", "_gyro"),
        ("PT100 (°C)", Temperature, "c", ""),
        ("Time (ms)", Time, "ms", ""),
        ("TimeUS", Time, "us", ""),
        ("timeMs", Time, "ms", ""),
        ("millis", Time, "ms", ""),
        ("timestamp [ns]", Time, "ns", ""),
        ("A_Timestamp_Unix_CAL (ms)", Time, "ms", ""),
        ("Time (UTC) [s]", Time, "s", ""),
        ("Elapsed seconds", Time, "s", ""),
        ("Zeit [Sekunden]", Time, "s", ""),
        ("Zeitpunkt", Time, "?", ""),
        ("Uhrzeit", Time, "?", ""),
        ("Aufnahme", Time, "?", ""),
        ("Time (min)", Time, "!", ""),
        ("counts x [1]", Counts, "", "_x"),
        ("counts y [counts]", Counts, "", "_y"),
        ("Impulse", Counts, "?", ""),
        ("Kreisel X [Impulse]", Counts, "", "_x"),
        ("Zähler z", Counts, "?", "_z"),
        ("Block [°C]", Temperature, "c", "_block"),
        ("Kammer °C", Temperature, "c", "_kammer"),
        ("Z (deg/s)", Rate, "dps", "_z"),
    ];

    #[test]
    fn every_spelling_has_its_quantity_unit_and_axis() {
        for (header, quantity, unit, place) in SPELLINGS {
            let named = Named::of(header, None).unwrap_or_else(|| panic!("{header}"));
            let found = match &named.unit {
                HeaderUnit::Known(ending) => ending,
                HeaderUnit::Unread(_) => "!",
                HeaderUnit::Open => "?",
            };
            assert_eq!((named.quantity, found, named.place.as_str()), (quantity, unit, place), "{header}");
        }
    }

    /// Other sensors, tables, estimates, numbers of rows.
    #[test]
    fn names_of_other_things_are_none_of_ours() {
        for header in [
            "Accel X (m/s²)",
            "ax",
            "Table rate (deg/s)",
            "sample_rate",
            "PacketCounter",
            "SampleTimeFine",
            "row count",
            "Mag Y",
            "gyro_bias_x",
            "w",
            "g",
            "x",
            "Channel C",
            "voltage [V]",
            "Frame rate",
            "",
            "°",
            "(",
            "[]",
            "status [1]",
        ] {
            assert_eq!(Named::of(header, None).filter(|named| named.by_unit.is_none()), None, "{header}");
        }
    }

    /// The line of units counts as brackets do.
    #[test]
    fn a_line_of_units_is_a_bracket() {
        for (header, quantity, unit, place) in SPELLINGS {
            let Some((name, rest)) = header.split_once(" [").or_else(|| header.split_once(" (")) else { continue };
            if !rest.contains(['(', '[']) {
                let named = Named::of(name, Some(rest.trim_end_matches([']', ')']))).unwrap();
                let known = matches!(named.unit, HeaderUnit::Known(ending) if ending == unit);
                assert_eq!((named.quantity, known, named.place.as_str()), (quantity, unit != "!", place), "{header}");
            }
        }
    }

    proptest::proptest! {
        #[test]
        fn any_header_has_a_meaning_or_none(header in "\\PC{0,30}", unit in proptest::option::of("\\PC{0,8}")) {
            Named::of(&header, unit.as_deref());
        }
    }
}
