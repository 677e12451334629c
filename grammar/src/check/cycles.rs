//! Types that inherit from themselves.
//!
//! Guarantee: it takes time in proportion to what is declared, however types inherit from each other.

use crate::Types;
use std::collections::BTreeMap;

/// By type, a number that two have in common if each inherits from the other.
pub(super) fn cycles(types: &Types) -> BTreeMap<&str, usize> {
    let mut above: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    let mut below: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for declaration in &types.declarations {
        for name in &declaration.names {
            let parents = declaration.parents.iter().map(crate::Name::as_str);
            for parent in parents {
                above.entry(name).or_default().push(parent);
                below.entry(parent).or_default().push(name);
            }
        }
    }
    // Kosaraju: in the order in which a walk upwards leaves them, last first, walks downwards.
    let mut left = Vec::new();
    let mut seen = BTreeMap::new();
    for name in above.keys() {
        walk(&above, name, 0, &mut seen, &mut left);
    }
    let mut number = BTreeMap::new();
    for (index, name) in left.into_iter().rev().enumerate() {
        walk(&below, name, index, &mut number, &mut Vec::new());
    }
    number
}

/// Gives a type, and what it leads to, the number, where they have none; in the order in which they are left.
fn walk<'t>(
    links: &BTreeMap<&'t str, Vec<&'t str>>,
    start: &'t str,
    number: usize,
    seen: &mut BTreeMap<&'t str, usize>,
    left: &mut Vec<&'t str>,
) {
    if seen.contains_key(start) {
        return;
    }
    seen.insert(start, number);
    let mut path = vec![(start, 0)];
    while let Some((name, next)) = path.last_mut() {
        match links.get(name).and_then(|all| all.get(*next)) {
            Some(&other) => {
                *next += 1;
                if !seen.contains_key(other) {
                    seen.insert(other, number);
                    path.push((other, 0));
                }
            }
            None => {
                left.push(name);
                path.pop();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parse_grammar;
    use std::collections::BTreeSet;

    fn cyclic(declared: &str) -> Vec<String> {
        let text = format!("name=x\n===\ntypes {{ {declared} }}\n===\n");
        let (grammar, _) = parse_grammar(&text, "x");
        let types = &grammar.types;
        let numbers = cycles(types);
        let itself = |name: &str| {
            let mut parents = types.parents(name);
            parents.any(|parent| numbers.get(parent.as_str()) == numbers.get(name))
        };
        let names = types.names().map(crate::Name::as_str);
        names
            .filter(|name| itself(name))
            .map(str::to_owned)
            .collect()
    }

    #[test]
    fn only_what_inherits_from_itself_is_in_a_cycle() {
        assert_eq!(cyclic("(a : b) (b : c) (c)"), [""; 0]);
        assert_eq!(cyclic("(a : a) (b : a)"), ["a"]);
        // Two cycles, and a way from one to the other.
        let two = "(a : b) (b : a way) (way : c) (c : d) (d : c) (e : a)";
        assert_eq!(cyclic(two), ["a", "b", "c", "d"]);
    }

    #[test]
    fn a_long_chain_of_types_is_read_at_once() {
        let chain: Vec<String> = (0..4_000).map(|i| format!("(t{i} : t{})", i + 1)).collect();
        let text = format!("name=x\n===\ntypes {{ {} }}\n===\n", chain.join(" "));
        let (grammar, _) = parse_grammar(&text, "x");
        let numbers: BTreeSet<usize> = cycles(&grammar.types).into_values().collect();
        assert_eq!(numbers.len(), 4_001);
    }
}
