//! `explain`: what a finding means, and what to do at the machine.

mod glossary;

use crate::decode::USAGE;
use crate::say;
use clap::Args;
use dissectors::finding::Code;
use dissectors::protocol::{codes, codes_named};
use glossary::{WORDS, Word, word};
use std::process::ExitCode;

/// Columns of a line of text.
const WIDTH: usize = 96;

/// Which finding.
#[derive(Args, Debug)]
pub struct Arguments {
    /// A finding's code, such as slin.checksum, or what is behind its point; or a word such as
    /// withheld. Without one, all are listed.
    code: Option<String>,
}

/// Explains it.
pub fn run(arguments: &Arguments) -> ExitCode {
    let Some(name) = &arguments.code else {
        let list = codes().map(|code| {
            format!("{:<24} {:<8} {}\n", code.name, code.severity.name(), code.meaning)
        });
        let words = WORDS.iter().map(|word| format!("{:<24} {}\n", word.name, word.meaning));
        let heading = "\nWords that stand beside them\n".to_owned();
        return super::print(&list.chain([heading]).chain(words).collect::<String>());
    };
    match codes().find(|code| code.name == name) {
        Some(code) => super::print(&explanation(code)),
        None => explain_short(name),
    }
}

/// A code without its protocol, as the last lines say it.
fn explain_short(name: &str) -> ExitCode {
    let mut found = codes_named(name);
    let word = word(name);
    match (word, &found[..]) {
        (Some(word), []) => return super::print(&definition(word)),
        (Some(word), codes) => {
            let texts = codes.iter().map(|code| format!("\n{}", explanation(code)));
            return super::print(&(definition(word) + &texts.collect::<String>()));
        }
        (None, [code]) => return super::print(&explanation(code)),
        (None, _) => {}
    }
    if found.is_empty() && !name.is_empty() {
        found = codes().filter(|code| code.name.contains(name)).collect();
    }
    if found.is_empty() {
        say!("fieldtap: there is no finding or word {name}: `fieldtap explain` lists them");
    } else {
        let names: Vec<&str> = found.iter().map(|code| code.name).collect();
        say!("fieldtap: {name} is not all of a finding's name: {}", names.join(", "));
    }
    ExitCode::from(USAGE)
}

fn definition(word: &Word) -> String {
    let what_follows = wrapped(word.next, "  ", "  ");
    format!("{}\n{}\nWhat follows\n{what_follows}", word.name, wrapped(word.meaning, "", ""))
}

fn explanation(code: &Code) -> String {
    let mut text = format!("{} ({})\n", code.name, code.severity.name());
    text.push_str(&wrapped(code.meaning, "", ""));
    for (heading, paragraph) in [("The rule", code.rule), ("The evidence", code.evidence)] {
        text.push_str(&format!("\n{heading}\n{}", wrapped(paragraph, "  ", "  ")));
    }
    for (heading, list) in
        [("Likely causes, the likeliest first", code.causes), ("What to do next", code.next)]
    {
        text.push_str(&format!("\n{heading}\n"));
        for (number, item) in (1..).zip(list) {
            text.push_str(&wrapped(item, &format!("  {number}. "), "     "));
        }
    }
    text
}

/// A paragraph in lines, the first with its own indent.
fn wrapped(paragraph: &str, first: &str, rest: &str) -> String {
    let mut text = String::new();
    let mut line = first.to_owned();
    let mut is_empty = true;
    for word in paragraph.split(' ') {
        if !is_empty && line.chars().count() + 1 + word.chars().count() > WIDTH {
            text.push_str(&line);
            text.push('\n');
            line = rest.to_owned();
            is_empty = true;
        }
        if !is_empty {
            line.push(' ');
        }
        line.push_str(word);
        is_empty = false;
    }
    text + &line + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_explanation_is_complete_and_fits() {
        for code in codes() {
            let text = explanation(code);
            assert!(!code.causes.is_empty() && !code.next.is_empty(), "{}", code.name);
            assert!(!code.cure.one.is_empty() && !code.cure.all.is_empty(), "{}", code.name);
            for line in text.lines() {
                assert!(line.chars().count() <= WIDTH, "{line}");
            }
        }
    }

    #[test]
    fn every_word_fits() {
        for word in &WORDS {
            let text = definition(word);
            assert!(text.lines().all(|line| line.chars().count() <= WIDTH), "{text}");
        }
    }

    /// What is in force unless somebody said otherwise is no advice.
    #[test]
    fn no_cure_advises_a_default() {
        for code in codes() {
            for default in ["--checksum auto", "--profile auto", "--invert auto", "--bitrate auto"]
            {
                let cures = [code.cure.one, code.cure.all];
                let advice = cures.iter().chain(code.next);
                assert!(!advice.into_iter().any(|it| it.contains(default)), "{}", code.name);
            }
        }
    }
}
