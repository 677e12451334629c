//! What of a grammar can be used although something is wrong with it.
//!
//! Guarantee: no rule is left in which an error lies, and none that means something else without
//! what is left out.

use crate::{Combo, Diagnostic, Grammar, Name, Severity, Span, unfold};

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
    /// Types, or an include.
    Other,
}

/// The sound rules of a grammar.
#[derive(Debug, Clone)]
pub struct Sound {
    /// The grammar without what is left out.
    pub grammar: Grammar,
    /// The rules and combos that are left out, in the order of their places, as far as their names
    /// could be read.
    pub left_out: Vec<Name>,
}

impl Grammar {
    /// What can be used of it, given what reading it found: all but the rules and combos that an
    /// error lies in, and the combos that are made of such. `None` where an error lies anywhere
    /// else, in the types or an include: then no rule's meaning is certain.
    pub fn sound(&self, diagnostics: &[Diagnostic]) -> Option<Sound> {
        let errors = diagnostics
            .iter()
            .filter(|diagnostic| diagnostic.severity() == Severity::Error);
        let mut broken: Vec<usize> = Vec::new();
        for error in errors {
            let region = self.region(error.span)?;
            match self.regions[region].of {
                Part::Rule(_) => broken.push(region),
                Part::Other => return None,
            }
        }
        broken.sort_unstable();
        broken.dedup();
        let is_broken = |name: &Name| {
            let region = self.region(name.span());
            region.is_some_and(|region| broken.contains(&region))
        };
        let mut left_out: Vec<Name> = Vec::new();
        for &region in &broken {
            if let Part::Rule(Some(name)) = &self.regions[region].of {
                left_out.push(name.clone());
            }
        }
        let mut grammar = self.clone();
        grammar.rules.retain(|rule| !is_broken(&rule.name));
        grammar.combos.retain(|combo| !is_broken(&combo.name));
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
        Some(Sound { grammar, left_out })
    }

    /// The part of its file that a place is in.
    fn region(&self, place: Span) -> Option<usize> {
        let regions = self.regions.iter().enumerate();
        let before = regions.filter(|(_, region)| {
            region.start.file == place.file && region.start.start <= place.start
        });
        let last = before.max_by_key(|(_, region)| region.start.start)?;
        Some(last.0)
    }
}

#[cfg(test)]
mod tests {
    use crate::{has_errors, parse_grammar};

    const TYPES: &str = "name=g\n===\ntypes\n{\n(room robot : thing)\n}\n===\n";

    fn rule(name: &str, left: &str) -> String {
        format!("{name} : active(1)\n{{\n\t{{ {left} }}\n\t=>\n\t{{ {left} }}\n}}\n")
    }

    /// The names of the sound rules and of those left out.
    fn sound(text: &str) -> Option<[Vec<String>; 2]> {
        let (grammar, diagnostics) = parse_grammar(text, "g.aggl");
        assert!(has_errors(&diagnostics), "{diagnostics:?}");
        let sound = grammar.sound(&diagnostics)?;
        let rules = sound.grammar.all_rules().map(|rule| rule.name.to_string());
        let left_out = sound.left_out.iter().map(ToString::to_string);
        Some([rules.collect(), left_out.collect()])
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
        ] {
            let found = sound(&format!("{TYPES}{good}{bad}{last}")).unwrap();
            assert_eq!(found, [vec!["good", "last"], vec!["bad"]], "{bad}");
        }
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
    fn no_rule_can_be_used_where_the_types_are_wrong_or_a_file_is_missing() {
        let good = rule("good", "r:robot");
        let types = "name=g\n===\ntypes\n{\n(robot thing)\n(thing : robot\n}\n===\n";
        assert_eq!(sound(&format!("{types}{good}")), None);
        assert_eq!(sound(&format!("{TYPES}include(no.aggl)\n{good}")), None);
        assert_eq!(sound(&format!("nonsense\n===\n{good}")), None);
    }
}
