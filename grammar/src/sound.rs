//! What of a grammar can be used although something is wrong with it.
//!
//! Guarantee: no rule is left in which an error lies, none that is made of what is left out, and none that
//! uses a type of which a file that could not be read may say something else.

use crate::{Combo, Diagnostic, Grammar, Name, Problem, Severity, Span, check, unfold};

/// Where something of a file begins, and goes on to where the next begins.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Region {
    /// Of which it is the beginning alone.
    pub start: Span,
    /// What begins there.
    pub of: Part,
}

/// What a part of a file is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Part {
    /// A rule or combo, with its name where it could be read.
    Rule(Option<Name>),
    /// A types block.
    Types,
    /// An include.
    Include,
}

/// The sound rules of a grammar.
#[derive(Debug, Clone)]
pub struct Sound {
    /// The grammar without what is left out.
    pub grammar: Grammar,
    /// The rules and combos that are left out, in the order of their places, as far as their names
    /// could be read.
    pub left_out: Vec<Name>,
    /// The files that could not be read. Types in them that inherit from those that are known are missing.
    pub missing: Vec<Name>,
    /// Rules that are left out, too, because they use types that only those files can declare.
    pub dependent: Vec<Name>,
}

/// Why nothing of a grammar can be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Unsound {
    /// An error lies in a types block.
    #[error(
        "no rule can be used, because every rule is matched by the types, in which an error lies"
    )]
    Types,
    /// A file cannot be read, and what was read declares no types.
    #[error("no rule can be used, because the types of all of them may be declared in `{path}`")]
    Include {
        /// The file as it is written.
        path: String,
    },
}

impl Grammar {
    /// What can be used of it, given what reading it found: all but the rules and combos that an
    /// error lies in, the combos that are made of such, and, where a file is missing, the rules with types
    /// that are not declared in the others. What is wrong in the header keeps no rule from being used.
    ///
    /// # Errors
    /// [`Unsound`] where no rule's meaning is certain.
    pub fn sound(&self, diagnostics: &[Diagnostic]) -> Result<Sound, Unsound> {
        let errors = diagnostics
            .iter()
            .filter(|diagnostic| diagnostic.severity() == Severity::Error);
        let mut broken: Vec<usize> = Vec::new();
        let mut missing: Vec<Name> = Vec::new();
        for error in errors {
            let Some(region) = self.region(error.span) else {
                continue;
            };
            match self.regions[region].of {
                Part::Rule(_) => broken.push(region),
                Part::Types => return Err(Unsound::Types),
                Part::Include => {
                    let path = match &error.problem {
                        Problem::Include { path, .. } => path,
                        _ => "?",
                    };
                    missing.push(Name::new(path, error.span));
                }
            }
        }
        let mut dependent = Vec::new();
        if let Some(path) = missing.first() {
            if self.types.is_empty() {
                let path = path.to_string();
                return Err(Unsound::Include { path });
            }
            for finding in check::check_grammar(self, &[], false) {
                if matches!(finding.problem, Problem::UnknownType { .. }) {
                    dependent.extend(self.region(finding.span));
                }
            }
        }
        broken.sort_unstable();
        broken.dedup();
        dependent.retain(|region| broken.binary_search(region).is_err());
        dependent.sort_unstable();
        dependent.dedup();
        let unusable = |name: &Name| {
            let region = self.region(name.span());
            region.is_some_and(|region| {
                broken.binary_search(&region).is_ok() || dependent.binary_search(&region).is_ok()
            })
        };
        let names = |regions: &[usize]| {
            let parts = regions.iter().map(|&region| &self.regions[region].of);
            let name = |part: &Part| match part {
                Part::Rule(name) => name.clone(),
                _ => None,
            };
            parts.filter_map(name).collect::<Vec<Name>>()
        };
        let (mut left_out, dependent) = (names(&broken), names(&dependent));
        let mut grammar = self.clone();
        grammar.rules.retain(|rule| !unusable(&rule.name));
        grammar.combos.retain(|combo| !unusable(&combo.name));
        // A combo may be made of combos.
        let stands = |grammar: &Grammar, combo: &Combo| {
            let mut steps = combo.steps.iter();
            steps.all(|step| {
                let rule = grammar.rules.iter().any(|rule| rule.name == step.rule);
                rule || grammar.combos.iter().any(|other| other.name == step.rule)
            })
        };
        while let Some(at) = grammar
            .combos
            .iter()
            .position(|combo| !stands(&grammar, combo))
        {
            left_out.push(grammar.combos.remove(at).name);
        }
        left_out.sort_by_key(Name::span);
        (grammar.unfolded, _) = unfold::unfold(&grammar);
        Ok(Sound {
            grammar,
            left_out,
            missing,
            dependent,
        })
    }

    /// The part of its file that a place is in.
    fn region(&self, place: Span) -> Option<usize> {
        // They lie in the order of the files and of their lines.
        let before =
            |region: &Region| (region.start.file, region.start.start) <= (place.file, place.start);
        let last = self.regions.partition_point(before).checked_sub(1)?;
        (self.regions[last].start.file == place.file).then_some(last)
    }
}

#[cfg(test)]
mod tests {
    use super::Unsound;
    use crate::{has_errors, parse_grammar};

    const TYPES: &str = "name=g\n===\ntypes\n{\n(room robot : thing)\n}\n===\n";

    fn rule(name: &str, left: &str) -> String {
        format!("{name} : active(1)\n{{\n\t{{ {left} }}\n\t=>\n\t{{ {left} }}\n}}\n")
    }

    /// The names of the sound rules and of those left out.
    #[allow(clippy::panic_in_result_fn, reason = "a wrong answer fails the test")]
    fn sound(text: &str) -> Result<[Vec<String>; 2], Unsound> {
        let (grammar, diagnostics) = parse_grammar(text, "g.aggl");
        assert!(has_errors(&diagnostics), "{diagnostics:?}");
        let sound = grammar.sound(&diagnostics)?;
        let rules = sound.grammar.all_rules().map(|rule| rule.name.to_string());
        let left_out = sound.left_out.iter().chain(&sound.dependent);
        Ok([rules.collect(), left_out.map(ToString::to_string).collect()])
    }

    #[test]
    fn rules_beside_a_broken_one_can_be_used() {
        let good = rule("good", "r:robot a:room r->a(in)");
        let last = rule("last", "a:room");
        for bad in [
            rule("bad", "r:robot a:room r->a(in"),
            rule("bad", "r:robt"),
            rule("bad", "r:robot r->x(in)"),
            rule("dormant bad", "r:robot r->->x(in)"),
            rule("bad", "r:robot").replace("bad :", "bad"),
        ] {
            let found = sound(&format!("{TYPES}{good}{bad}{last}")).unwrap();
            assert_eq!(found, [vec!["good", "last"], vec!["bad"]], "{bad}");
        }
    }

    #[test]
    fn a_modifier_after_the_name_is_told_where_to_stand() {
        let text = format!(
            "{TYPES}{}",
            rule("go", "r:robot").replace("active", "dormant active")
        );
        let (_, diagnostics) = parse_grammar(&text, "g.aggl");
        let defects = crate::Defects { diagnostics }.to_string();
        let told = "g.aggl:8:6: error: `dormant` stands before a rule's name, not here (write `dormant go : ...`)";
        assert_eq!(defects, told);
    }

    #[test]
    fn the_first_of_two_rules_of_one_name_can_be_used() {
        let text = format!("{TYPES}{}{}", rule("a", "r:robot"), rule("a", "r:room"));
        assert_eq!(sound(&text).unwrap(), [["a"], ["a"]]);
    }

    #[test]
    fn a_combo_of_a_broken_rule_is_left_out_with_it() {
        let [good, bad] = [rule("good", "r:robot"), rule("bad", "r:robt")];
        let combo = |name, steps| format!("{name} : active(1)\n{{\n{steps}\nwhere:\n}}\n");
        let both = combo("both", "\tgood as x\n\tbad as y");
        let twice = combo("twice", "\tgood as x\n\tgood as y");
        let [rules, left_out] = sound(&format!("{TYPES}{good}{bad}{both}{twice}")).unwrap();
        assert!(rules.contains(&"good".to_owned()), "{rules:?}");
        assert!(!rules.iter().any(|rule| rule.starts_with("both")));
        assert_eq!(left_out, ["bad", "both"]);
    }

    #[test]
    fn a_rule_of_declared_types_can_be_used_where_a_file_is_missing() {
        let good = rule("good", "r:robot a:room r->a(in)");
        let kitchen = rule("cook", "k:kitchen");
        let include = "include(no.aggl)\n";
        let combo = "both : active(1)\n{\n\tgood as x\n\tcook as y\nwhere:\n}\n";
        let found = sound(&format!("{TYPES}{include}{good}{kitchen}{combo}")).unwrap();
        assert_eq!(found, [vec!["good"], vec!["both", "cook"]]);
        let path = "no.aggl".to_owned();
        let untyped = sound(&format!("name=g\n===\n{include}{good}"));
        assert_eq!(untyped, Err(Unsound::Include { path }));
    }

    #[test]
    fn a_header_keeps_no_rule_from_being_used_but_types_keep_all() {
        let good = rule("good", "r:robot");
        let found = sound(&format!("nonsense\n===\n{good}")).unwrap();
        assert_eq!(found, [vec!["good".to_owned()], vec![]]);
        let types = "name=g\n===\ntypes\n{\n(robot thing)\n(thing : robot\n}\n===\n";
        assert_eq!(sound(&format!("{types}{good}")), Err(Unsound::Types));
    }
}
