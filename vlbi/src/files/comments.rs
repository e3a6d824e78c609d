//! Comments of kerrlight's CSV, in lines that start with `#`: `key: value`, one a line. Lines of
//! other keys are passed over.

use super::{Names, locate, number};
use crate::array::{self, Station};
use crate::observation::{Channel, Observation};
use core::fmt::Write;

/// All that is known besides the rows.
pub fn write(observation: &Observation) -> String {
    let mut text = String::new();
    let mut line = |key: &str, value: &str| {
        // A value of several lines would end the comment.
        let value = value.replace(char::is_control, " ");
        let _ = writeln!(text, "# {key}: {value}");
    };
    let mut number = |key: &str, value: Option<f64>| {
        if let Some(value) = value {
            line(key, &value.to_string());
        }
    };
    number("ra_h", observation.position.map(|p| p.ra_hours));
    number("dec_deg", observation.position.map(|p| p.dec_deg));
    number("mjd", observation.mjd.map(f64::from));
    number("frequency_hz", observation.frequency_hz);
    number("bandwidth_hz", observation.bandwidth_hz);
    if !observation.source.is_empty() {
        line("source", &observation.source);
    }
    for (k, channel) in observation.channels.iter().enumerate() {
        line("channel", &format!("{k} {} {}", channel.frequency_hz, channel.bandwidth_hz));
    }
    for station in observation.stations.iter().filter(|s| **s != Station::named(&s.name)) {
        line("station", &array::columns(station));
    }
    observation.history.iter().for_each(|entry| line("history", entry));
    text
}

/// Takes in a line of comment, without its `#`; tells whether it is one of these.
pub fn read(line: &str, observation: &mut Observation, names: &mut Names) -> Result<bool, String> {
    let Some((key, value)) = line.trim().split_once(": ") else { return Ok(false) };
    let hertz = |name: &str| match number(value, name)? {
        hertz if hertz > 0.0 => Ok(Some(hertz)),
        hertz => Err(format!("{name} = {hertz} must be positive")),
    };
    match key {
        "source" => value.clone_into(&mut observation.source),
        "ra_h" => locate(observation, Some(number(value, "ra_h")?), None)?,
        "dec_deg" => locate(observation, None, Some(number(value, "dec_deg")?))?,
        "mjd" => {
            let mjd = number(value, "mjd")?;
            if !(-1e6..=1e6).contains(&mjd) || mjd.fract() != 0.0 {
                return Err(format!("mjd = {mjd} is not allowed: a whole number near our time"));
            }
            observation.mjd = Some(mjd as i32);
        }
        "frequency_hz" => observation.frequency_hz = hertz("frequency_hz")?,
        "bandwidth_hz" => observation.bandwidth_hz = hertz("bandwidth_hz")?,
        "channel" => observation.channels.push(channel(value, observation.channels.len())?),
        "station" => names.add(&value.split_whitespace().take(40).collect::<Vec<_>>())?,
        "history" => observation.history.push(value.to_owned()),
        _ => return Ok(false),
    }
    Ok(true)
}

/// `number frequency bandwidth`, numbers in order.
fn channel(value: &str, expected: usize) -> Result<Channel, String> {
    let words: Vec<&str> = value.split_whitespace().take(4).collect();
    let [index, frequency, bandwidth] = words[..] else {
        return Err("a channel is number, frequency and bandwidth in Hz".to_owned());
    };
    if index.parse() != Ok(expected) || expected >= usize::from(u16::MAX) {
        return Err(format!("channel {}: {expected} was expected", super::shortened(index)));
    }
    let frequency_hz = number(frequency, "channel's frequency")?;
    if frequency_hz <= 0.0 {
        return Err(format!("channel's frequency = {frequency_hz} Hz must be positive"));
    }
    Ok(Channel { frequency_hz, bandwidth_hz: number(bandwidth, "channel's bandwidth")? })
}
