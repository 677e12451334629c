//! Why a goal cannot be reached: what of it nothing brings about, even if rules took nothing away;
//! for each the rule that comes nearest, and what that rule lacks. This file guarantees that what
//! it calls unreachable is.

use super::Problem;
use super::program::{Change, Environment, Link, Object, Operator, UNBOUND};
use super::reach::Reached;
use super::truth::always;

/// So many rules are followed back from what is missing.
const DEPTH: usize = 4;

/// So many choices are tried to find what a rule lacks.
const PATIENCE: usize = 20_000;

impl Problem {
    /// What of the goal cannot be reached, in words; nothing where each part by itself can.
    pub(crate) fn unreachable(&self, reached: &Reached) -> Vec<String> {
        let goal = &self.goal;
        let environment = goal.environment();
        let mut reasons = Vec::new();
        for (slot, variable) in goal.variables.iter().enumerate() {
            let there = match environment[slot] {
                UNBOUND => reached.facts.objects_of(&variable.types).next().is_some(),
                object => reached.facts.is_of(object, &variable.types),
            };
            if !there {
                let what = self.words().types(&variable.types);
                reasons.push(match environment[slot] {
                    UNBOUND => format!("there is no {what}, and no rule creates one"),
                    object => format!("{} is no {what}", self.name(object)),
                });
            }
        }
        if !reasons.is_empty() {
            return reasons;
        }
        for &link in &goal.links {
            if !some_link(goal, link, &environment, reached) {
                let why = self.why_no_link(goal, link, &environment, reached, &mut Vec::new());
                let link = self.words().link(link, goal, &environment);
                reasons.push(format!("{link} cannot be reached: {why}"));
            }
        }
        for &link in &goal.absent {
            let bound = [link.from, link.to].map(|slot| environment[slot as usize] != UNBOUND);
            if bound == [true, true]
                && self.world.facts.has_link(link.at(&environment))
                && !self.program.removed[usize::from(link.label)]
            {
                let link = self.words().link(link, goal, &environment);
                reasons.push(format!("{link} holds, and no rule takes it away"));
            }
        }
        if goal.fixed.len() == goal.bound {
            for test in &goal.tests {
                let mut environment = environment.clone();
                let known = always(test, &self.program, &self.world.facts, &mut environment);
                if known == Some(false) {
                    let test = self.words().test(test, goal, &environment);
                    reasons.push(format!("{test} does not hold, and no rule changes that"));
                }
            }
        }
        reasons
    }

    /// What keeps every rule from making a link.
    fn why_no_link(
        &self,
        asking: &Operator,
        link: Link,
        environment: &[Object],
        reached: &Reached,
        asked: &mut Vec<(u16, Object, Object)>,
    ) -> String {
        let words = self.words();
        let label = words.vocabulary.labels.name(link.label);
        let [from, to] = [link.from, link.to].map(|slot| environment[slot as usize]);
        asked.push((link.label, from, to));
        let mut nearest: Option<(usize, String)> = None;
        for operator in &self.program.operators {
            let mut made = Vec::new();
            operator.each_change(&mut |change| {
                if let Change::Link(made_here) = change
                    && made_here.label == link.label
                {
                    made.push(*made_here);
                }
            });
            for candidate in made {
                let bind = |environment: &mut Environment, slot: u32, asked: u32| {
                    let slot = slot as usize;
                    let Some(variable) = operator.variables.get(slot) else {
                        return true;
                    };
                    let object = [from, to][usize::from(asked != link.from)];
                    if object == UNBOUND {
                        let wanted = &asking.variables[asked as usize].types;
                        return !variable.types.is_disjoint(wanted);
                    }
                    if slot >= operator.bound
                        || !reached.facts.is_of(object, &variable.types)
                        || environment[..operator.bound].contains(&object)
                    {
                        return environment[slot] == object;
                    }
                    environment[slot] = object;
                    true
                };
                let mut start = operator.environment();
                if !bind(&mut start, candidate.from, link.from)
                    || !bind(&mut start, candidate.to, link.to)
                {
                    continue;
                }
                let lack = self.lack(operator, start, reached);
                let text = self.lack_in_words(operator, &lack, reached, asked);
                if nearest
                    .as_ref()
                    .is_none_or(|(depth, _)| lack.depth > *depth)
                {
                    nearest = Some((lack.depth, text));
                }
            }
        }
        nearest.map_or_else(
            || format!("no rule makes a link `{label}` there"),
            |(_, text)| text,
        )
    }

    fn lack_in_words(
        &self,
        operator: &Operator,
        lack: &Lack,
        reached: &Reached,
        asked: &mut Vec<(u16, Object, Object)>,
    ) -> String {
        let words = self.words();
        let rule = &operator.name;
        match lack.what {
            Missing::Link(link) => {
                let needed = words.link(link, operator, &lack.environment);
                let needed = format!("rule `{rule}` needs {needed}");
                let [from, to] = [link.from, link.to].map(|s| lack.environment[s as usize]);
                if !self.is_makeable(operator, link) {
                    return format!("{needed}, which no rule brings about");
                }
                if asked.len() >= DEPTH || asked.contains(&(link.label, from, to)) {
                    return needed;
                }
                let why = self.why_no_link(operator, link, &lack.environment, reached, asked);
                format!("{needed}; {why}")
            }
            Missing::Object(slot) => {
                let what = words.types(&operator.variables[slot].types);
                format!("rule `{rule}` needs another {what}")
            }
            Missing::Condition => match self.forbidden(operator, &lack.environment) {
                Some(what) => format!("rule `{rule}` needs {what}"),
                None => format!("the condition of rule `{rule}` cannot hold there"),
            },
        }
    }

    /// What of an operator's conditions never holds at a binding, in words.
    fn forbidden(&self, operator: &Operator, environment: &[Object]) -> Option<String> {
        let words = self.words();
        let whole = |slot: u32| environment[slot as usize] != UNBOUND;
        let kept = operator.absent.iter().find(|link| {
            whole(link.from)
                && whole(link.to)
                && self.world.facts.has_link(link.at(environment))
                && !self.program.removed[usize::from(link.label)]
        });
        if let Some(link) = kept {
            let link = words.link(*link, operator, environment);
            return Some(format!(
                "that {link} does not hold, but no rule takes it away"
            ));
        }
        if environment[..operator.bound].contains(&UNBOUND) {
            return None;
        }
        let broken = operator.tests.iter().find(|test| {
            let mut environment = environment.to_vec();
            always(test, &self.program, &self.world.facts, &mut environment) == Some(false)
        })?;
        let test = words.test(broken, operator, environment);
        Some(format!("{test}, which never holds there"))
    }

    /// Whether some rule makes links of that label between such types.
    fn is_makeable(&self, asking: &Operator, link: Link) -> bool {
        let fits = |operator: &Operator, slot: u32, asked: u32| {
            let wanted = &asking.variables[asked as usize].types;
            let made = operator.variables.get(slot as usize);
            made.is_none_or(|made| !made.types.is_disjoint(wanted))
        };
        let mut makeable = false;
        for operator in &self.program.operators {
            operator.each_change(&mut |change| {
                if let Change::Link(made) = change {
                    makeable |= made.label == link.label
                        && fits(operator, made.from, link.from)
                        && fits(operator, made.to, link.to);
                }
            });
        }
        makeable
    }

    /// What an operator lacks at the best binding that extends `start`.
    fn lack(&self, operator: &Operator, start: Environment, reached: &Reached) -> Lack {
        // A link that is not there whatever the others are bound to says most.
        let there = |link: &&Link| some_link(operator, **link, &start, reached);
        if let Some(&link) = operator.links.iter().find(|link| !there(link)) {
            return Lack {
                depth: operator.links.iter().filter(there).count(),
                what: Missing::Link(link),
                environment: start,
            };
        }
        let links = operator.links.iter();
        let mut search = LackSearch {
            operator,
            reached,
            makeable: links.map(|&l| self.is_makeable(operator, l)).collect(),
            tried: 0,
            best: None,
        };
        let mut met = vec![false; operator.links.len()];
        search.go(&mut start.clone(), &mut met, 0);
        search.best.unwrap_or(Lack {
            depth: 0,
            what: Missing::Condition,
            environment: start,
        })
    }
}

/// Whether a link may come to hold between what the slots may stand for.
fn some_link(operator: &Operator, link: Link, environment: &[Object], reached: &Reached) -> bool {
    let fits = |slot: u32, object: Object| {
        let slot = slot as usize;
        (environment[slot] == UNBOUND || environment[slot] == object)
            && reached.facts.is_of(object, &operator.variables[slot].types)
    };
    let pairs = reached.facts.pairs(link.label);
    pairs
        .iter()
        .any(|&(from, to)| fits(link.from, from) && fits(link.to, to))
}

/// What a rule lacks.
#[derive(Debug, Clone)]
struct Lack {
    /// How many of its needs are met before.
    depth: usize,
    what: Missing,
    environment: Environment,
}

#[derive(Debug, Clone, Copy)]
enum Missing {
    Link(Link),
    Object(usize),
    /// All links are there.
    Condition,
}

struct LackSearch<'a> {
    operator: &'a Operator,
    reached: &'a Reached,
    /// Which of the operator's links rules may make.
    makeable: Vec<bool>,
    tried: usize,
    best: Option<Lack>,
}

impl LackSearch<'_> {
    fn note(&mut self, depth: usize, what: Missing, environment: &Environment) {
        // Among equals the first: it follows the order in which the rule is written.
        if self.best.as_ref().is_none_or(|best| depth > best.depth) {
            self.best = Some(Lack {
                depth,
                what,
                environment: environment.clone(),
            });
        }
    }

    fn go(&mut self, environment: &mut Environment, met: &mut Vec<bool>, depth: usize) {
        self.tried += 1;
        if self.tried > PATIENCE {
            return;
        }
        let operator = self.operator;
        let open = |slot: u32| usize::from(environment[slot as usize] == UNBOUND);
        let next = (0..operator.links.len())
            .filter(|&index| !met[index])
            .min_by_key(|&index| {
                let link = operator.links[index];
                // What no rule makes stands fast: it is bound first.
                let ends = open(link.from) + open(link.to);
                (self.makeable[index], ends, index)
            });
        let Some(index) = next else {
            let variables = operator.variables[..operator.bound].iter().enumerate();
            for (slot, variable) in variables {
                let bound = &environment[..operator.bound];
                let mut others = self.reached.facts.objects_of(&variable.types);
                if environment[slot] == UNBOUND && others.all(|o| bound.contains(&o)) {
                    return self.note(depth + 1, Missing::Object(slot), environment);
                }
            }
            return self.note(depth + 2, Missing::Condition, environment);
        };
        let link = operator.links[index];
        met[index] = true;
        let mut any = false;
        for &(from, to) in self.reached.facts.pairs(link.label) {
            let before = environment.clone();
            if self.bind(environment, link.from, from) && self.bind(environment, link.to, to) {
                any = true;
                self.go(environment, met, depth + 1);
            }
            *environment = before;
        }
        met[index] = false;
        if !any {
            self.note(depth, Missing::Link(link), environment);
        }
    }

    fn bind(&self, environment: &mut Environment, slot: u32, object: Object) -> bool {
        let slot = slot as usize;
        if environment[slot] != UNBOUND {
            return environment[slot] == object;
        }
        let types = &self.operator.variables[slot].types;
        if environment[..self.operator.bound].contains(&object)
            || !self.reached.facts.is_of(object, types)
        {
            return false;
        }
        environment[slot] = object;
        true
    }
}
