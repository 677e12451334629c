//! The people of a world: those with a schedule, those of a stream, or those of a recording. Who
//! is simulated walks around what is in the way and turns to the robot when it speaks; who is
//! recorded does not know of the robot.

use super::obstacles::Obstacles;
use super::route::FloorPlan;
use super::walker::{Walker, Walking};
use super::walking::Disc;
use super::{Body, random};
use crate::scenario::{Begin, Entry, Person, Scenario, Stream};
use crate::tracks::Tracks;
use agents::messages::Speech;
use dsr::Time;
use nalgebra::{Point2, Vector2};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Who stands within this distance of the place spoken to is addressed, m.
const ADDRESSED: f64 = 0.8;
/// The robot is heard this far, m.
const HEARD: f64 = 3.5;
/// How long somebody who is addressed pays attention, s.
const ATTENTION: f64 = 6.0;
/// Somebody of a stream enters where nobody is this close, m; the robot twice that.
const ENTRY_GAP: f64 = 0.7;

/// A person with a schedule, and how far it has come.
#[derive(Debug, Clone)]
struct Scheduled {
    walker: Walker,
    /// The entry under way, or the next to begin.
    next: usize,
    under_way: bool,
    /// When the entry before was done.
    done: Time,
}

/// A stream and those of it who are under way.
#[derive(Debug, Clone)]
struct Flow {
    stream: Stream,
    random: ChaCha8Rng,
    under_way: Vec<Walker>,
    entered: usize,
}

#[derive(Debug, Clone)]
enum Source {
    Simulated {
        people: Vec<Person>,
        scheduled: Vec<Scheduled>,
        flows: Vec<Flow>,
    },
    Recorded {
        tracks: Tracks,
        start: Time,
    },
}

/// All people of a world.
#[derive(Debug, Clone)]
pub(super) struct Crowd {
    source: Source,
    bodies: Vec<Body>,
}

impl Crowd {
    pub(super) fn new(
        scenario: &Scenario,
        seed: u64,
        tracks: Option<Tracks>,
        plan: &FloorPlan,
    ) -> Self {
        let start = scenario.start;
        let source = if let Some(tracks) = tracks {
            Source::Recorded {
                tracks: tracks.placed(&scenario.tracks, scenario.bounds),
                start,
            }
        } else {
            let scheduled = scenario.people.iter().map(|person| Scheduled {
                walker: Walker::new(person),
                next: 0,
                under_way: false,
                done: start,
            });
            let flow = |stream: &Stream| {
                let random = random::stream(seed, &format!("stream/{}", stream.name));
                Flow {
                    stream: stream.clone(),
                    random,
                    under_way: Vec::new(),
                    entered: 0,
                }
            };
            Source::Simulated {
                people: scenario.people.clone(),
                scheduled: scheduled.collect(),
                flows: scenario.streams.iter().map(flow).collect(),
            }
        };
        let mut crowd = Self {
            source,
            bodies: Vec::new(),
        };
        crowd.gather(start);
        if let Source::Simulated { flows, .. } = &mut crowd.source {
            let robot = scenario.robot.pose.translation.vector.into();
            for flow in flows {
                flow.fill(robot, plan, &mut crowd.bodies);
            }
        }
        crowd.gather(start);
        crowd
    }

    /// Everybody who is in the world now.
    pub(super) fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// Moves everybody on by `dt` seconds until `now`.
    pub(super) fn step(
        &mut self,
        now: Time,
        dt: f64,
        robot: Disc,
        speech: &[Speech],
        obstacles: &Obstacles,
        plan: &FloorPlan,
    ) {
        if let Source::Simulated {
            people,
            scheduled,
            flows,
        } = &mut self.source
        {
            for words in speech {
                address(words, now, robot, scheduled, flows);
            }
            // Each sees those before them where they have got to, so no two take the same spot.
            let mut bodies = std::mem::take(&mut self.bodies);
            let walking = Walking {
                now,
                dt,
                robot,
                people,
                obstacles,
                plan,
            };
            for (one, person) in scheduled.iter_mut().zip(people.iter()) {
                if one.walker.present {
                    one.follow_schedule(person, now, plan);
                    one.walker.step(&walking, &bodies);
                    one.walker.show(&mut bodies);
                }
            }
            for flow in flows {
                for walker in &mut flow.under_way {
                    walker.step(&walking, &bodies);
                    walker.show(&mut bodies);
                }
                flow.renew(&walking, &mut bodies);
            }
        }
        self.gather(now);
    }

    fn gather(&mut self, now: Time) {
        self.bodies = match &self.source {
            Source::Recorded { tracks, start } => tracks.people_at(now.since(*start)),
            Source::Simulated {
                scheduled, flows, ..
            } => {
                let scheduled = scheduled.iter().map(|one| &one.walker);
                let all = scheduled.chain(flows.iter().flat_map(|flow| &flow.under_way));
                all.filter(|walker| walker.present)
                    .map(|walker| walker.body.clone())
                    .collect()
            }
        };
    }
}

/// Whoever stands nearest to the place that the robot speaks to turns to it, if within earshot.
fn address(
    words: &Speech,
    now: Time,
    robot: Disc,
    scheduled: &mut [Scheduled],
    flows: &mut [Flow],
) {
    let walkers = scheduled.iter_mut().map(|one| &mut one.walker);
    let walkers = walkers.chain(flows.iter_mut().flat_map(|flow| &mut flow.under_way));
    let listener = walkers
        .filter(|walker| {
            let at = walker.body.position;
            walker.present
                && (at - words.toward).norm() <= ADDRESSED
                && (at - robot.position).norm() <= HEARD
        })
        .min_by(|a, b| {
            let far = |walker: &Walker| (walker.body.position - words.toward).norm();
            far(a).total_cmp(&far(b))
        });
    if let Some(listener) = listener {
        listener.attention_until = Some(now + ATTENTION);
    }
}

impl Scheduled {
    /// Begins the next entry when its time has come, and ends the one that is done.
    fn follow_schedule(&mut self, person: &Person, now: Time, plan: &FloorPlan) {
        if self.under_way && self.walker.has_arrived() {
            self.under_way = false;
            self.done = now;
            if person.schedule[self.next].leave {
                self.walker.present = false;
            }
            self.next += 1;
            if self.next == person.schedule.len() && person.repeat {
                self.next = 0;
            }
        }
        let Some(entry) = person.schedule.get(self.next).filter(|_| !self.under_way) else {
            return;
        };
        let due = match entry.begin {
            Begin::At(time) => now >= time,
            Begin::After(seconds) => now.since(self.done) >= seconds - 1e-9,
        };
        if due {
            self.begin(entry, plan);
        }
    }

    fn begin(&mut self, entry: &Entry, plan: &FloorPlan) {
        self.under_way = true;
        if let Some(goal) = entry.go {
            self.walker.go(goal, plan);
        }
        if entry.go.is_some() || entry.face.is_some() {
            self.walker.face.clone_from(&entry.face);
        }
    }
}

impl Flow {
    /// Spreads the stream's people over its way, none beside the robot.
    fn fill(&mut self, robot: Point2<f64>, plan: &FloorPlan, bodies: &mut Vec<Body>) {
        for _ in 0..self.stream.people {
            let progress = self.random.random_range(0.0..0.95);
            let walker = self.enter(progress, plan);
            self.admit(walker, robot, bodies);
        }
    }

    /// Lets somebody in where there is room.
    fn admit(&mut self, walker: Walker, robot: Point2<f64>, bodies: &mut Vec<Body>) {
        let at = walker.body.position;
        let mut others = bodies.iter();
        if others.all(|other| (other.position - at).norm() > ENTRY_GAP)
            && (robot - at).norm() > 2.0 * ENTRY_GAP
        {
            bodies.push(walker.body.clone());
            self.under_way.push(walker);
        } else {
            self.entered -= 1;
        }
    }

    /// Somebody new, who has done this part of the way.
    fn enter(&mut self, progress: f64, plan: &FloorPlan) -> Walker {
        let way = self.stream.to - self.stream.from;
        let across = Vector2::new(-way.y, way.x).normalize();
        let half = self.stream.width / 2.0;
        let mut aside = || across * self.random.random_range(-half..=half);
        let from = self.stream.from + aside();
        let to = self.stream.to + aside();
        let [slow, fast] = self.stream.speed;
        let speed = self.random.random_range(slow..=fast);
        self.entered += 1;
        let name = format!("{}_{}", self.stream.name, self.entered);
        let heading = way.y.atan2(way.x);
        let body = Body::standing(
            &name,
            from + (to - from) * progress,
            heading,
            self.stream.radius,
        );
        let mut walker = Walker::of(body, speed);
        walker.go(to, plan);
        walker
    }

    /// Lets those who arrived leave, and others enter where there is room.
    fn renew(&mut self, walking: &Walking<'_>, bodies: &mut Vec<Body>) {
        let way = (self.stream.to - self.stream.from).normalize();
        let to = self.stream.to;
        self.under_way
            .retain(|walker| (to - walker.body.position).dot(&way) > 0.3 && !walker.has_arrived());
        for _ in self.under_way.len()..self.stream.people {
            let walker = self.enter(0.0, walking.plan);
            self.admit(walker, walking.robot.position, bodies);
        }
    }
}
