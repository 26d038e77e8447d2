//! Files that the user writes, as TOML: read, or refused in words about the file.

use serde::de::DeserializeOwned;

/// The words of the library for what was expected, and those of people.
const EXPECTED: [(&str, &str); 9] = [
    ("u8", "a whole number from 0 to 255"),
    ("u16", "a whole number from 0 to 65535"),
    ("u32", "a whole number of 0 or more"),
    ("i64", "a whole number"),
    ("f64", "a number"),
    ("a boolean", "true or false"),
    ("a string", "text in quotes"),
    ("a sequence", "a list in brackets"),
    ("a map", "a table"),
];

/// Reads a file's text.
///
/// # Errors
/// It is no TOML, or not of that shape: in which line, and what is wrong.
pub fn parse<T: DeserializeOwned>(text: &str) -> anyhow::Result<T> {
    toml::from_str(text).map_err(|error| {
        let start = error.span().map_or(0, |span| span.start).min(text.len());
        let line = text.as_bytes()[..start].iter().filter(|byte| **byte == b'\n').count() + 1;
        let said = text.lines().nth(line - 1).unwrap_or_default().trim();
        anyhow::anyhow!("line {line}, {said}: {}", plain(error.message()))
    })
}

/// A message without the names of types.
fn plain(message: &str) -> String {
    let message = message.trim().replace('`', "\"");
    let Some((what, expected)) = message.split_once(", expected ") else { return message };
    let known = EXPECTED.iter().find(|(word, _)| *word == expected).map(|(_, plain)| *plain);
    let expected = match (known, expected.strip_prefix("an array of length ")) {
        (Some(plain), _) => plain.to_owned(),
        (None, Some(count)) => format!("a list of {count}"),
        (None, None) if expected.starts_with("struct ") => "a table".to_owned(),
        (None, None) => expected.replace("one of ", "").replace('"', ""),
    };
    // What stands there is in the line that was told.
    match ["invalid type", "invalid value", "invalid length"].iter().any(|it| what.starts_with(it))
    {
        true => format!("expected {expected}"),
        false => format!("{what}: expected {expected}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Deserialize, Debug)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct File {
        rate: Option<u32>,
        flags: Option<[String; 3]>,
        is_low: Option<bool>,
        order: Option<Order>,
        part: Option<Part>,
    }

    #[derive(Deserialize, Debug)]
    #[serde(rename_all = "lowercase")]
    enum Order {
        Msb,
        Lsb,
    }

    #[derive(Deserialize, Debug)]
    #[allow(dead_code)]
    struct Part {
        name: String,
    }

    #[test]
    fn mistakes_are_told_in_the_words_of_the_file() {
        for (text, told) in [
            ("rate = \"x\"", "line 1, rate = \"x\": expected a whole number of 0 or more"),
            ("\nrate = -5", "line 2, rate = -5: expected a whole number of 0 or more"),
            ("is_low = 1", "line 1, is_low = 1: expected true or false"),
            ("flags = [\"SL\"]", "line 1, flags = [\"SL\"]: expected a list of 3"),
            ("part = 5", "line 1, part = 5: expected a table"),
            (
                "speed = 5",
                "line 1, speed = 5: unknown field \"speed\": expected rate, flags, is_low, order, \
                 part",
            ),
            (
                "order = \"up\"",
                "line 1, order = \"up\": unknown variant \"up\": expected msb or lsb",
            ),
            ("[part]", "line 1, [part]: missing field \"name\""),
        ] {
            assert_eq!(parse::<File>(text).unwrap_err().to_string(), told);
        }
    }
}
