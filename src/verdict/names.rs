//! Names of channels, put together.

/// The number of a name that ends in one, and what is before it.
fn parts(name: &str) -> (&str, Option<u64>) {
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
    (stem, name[stem.len()..].parse().ok())
}

/// Names in order: three or more that follow each other as `D1 to D7`.
pub fn together(names: &[&str]) -> String {
    let mut names = names.to_vec();
    names.sort_by_key(|name| parts(name));
    let follows = |one: &&str, next: &&str| {
        let ((stem, number), (next_stem, next_number)) = (parts(one), parts(next));
        stem == next_stem
            && number.is_some()
            && number.and_then(|n| n.checked_add(1)) == next_number
    };
    let said = names.chunk_by(follows).map(|run| match run {
        [first, _, .., last] => format!("{first} to {last}"),
        few => few.join(", "),
    });
    said.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::together;

    #[test]
    fn neighbours_stand_together_whatever_order_they_came_in() {
        for (names, told) in [
            (&["D3", "D4", "D7", "D2", "D1", "D6", "D5"][..], "D1 to D7"),
            (&["D10", "D9", "D2", "D8"], "D2, D8 to D10"),
            (&["D1", "D2"], "D1, D2"),
            (&["TX", "RX"], "RX, TX"),
            (&["A1", "B2", "A2", "A3"], "A1 to A3, B2"),
            (&["D18446744073709551615", "D0"], "D0, D18446744073709551615"),
        ] {
            assert_eq!(together(names), told);
        }
    }
}
