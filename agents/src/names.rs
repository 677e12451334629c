//! What is said of a name that nothing has, for whoever misspelt it. One wording for files, settings and the graph.

/// "did you mean ...?" where something near is known, else all that is; empty where nothing is.
pub fn suggest<'a>(wrong: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    match dsr::suggest(wrong, known.iter().copied()) {
        Some(name) => format!("did you mean `{name}`?"),
        None if known.is_empty() => String::new(),
        None => format!("known are: {}", known.join(", ")),
    }
}

/// [`suggest`] as the end of a sentence.
pub fn suggestion<'a>(wrong: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let said = suggest(wrong, known);
    if said.is_empty() {
        said
    } else {
        format!("; {said}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_said_or_else_all() {
        let rooms = ["kitchen", "hall"];
        assert_eq!(suggest("kichen", rooms), "did you mean `kitchen`?");
        assert_eq!(suggestion("attic", rooms), "; known are: kitchen, hall");
        assert_eq!(suggestion("attic", []), "");
    }
}
