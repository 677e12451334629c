//! What is made anew when something changes: no more than it takes, and the same as from scratch.

use super::*;
use crate::social_mapping::zones::{Levels, Proxemics};
use proptest::prelude::*;

#[test]
fn the_dirty_region_is_where_costs_differ() {
    let mut scene = hall();
    scene.people.push(person("ana", pose(5.0, 5.0, 0.0)));
    let mut mapper = SocialMapper::new(SocialConfig::default()).unwrap();
    let mut update = |scene: &SocialScene| mapper.update(noon(), scene).unwrap();
    let first = update(&scene);
    assert_eq!(first.dirty, first.grid.whole());
    assert!(update(&scene).dirty.is_empty());
    scene.people[0].world_from_person = pose(5.0 + 1e-9, 5.0, 0.0);
    assert!(update(&scene).dirty.is_empty(), "no cell can tell");
    scene.people[0].world_from_person = pose(5.2, 5.0, 0.0);
    let Region { columns, rows } = update(&scene).dirty;
    // The social zone reaches from 1.07 m behind to 2.15 m ahead, and 1.61 m to the sides.
    assert_eq!((columns, rows), ((39, 73), (34, 66)));
    scene.people.clear();
    let map = update(&scene);
    assert!(!map.dirty.is_empty() && map.grid.costs.iter().all(|c| *c == FREE));
}

#[test]
fn somebody_who_leaves_disturbs_nobody_else() {
    let mut scene = hall();
    let place = |x: f64| pose(x, 5.0, FRAC_PI_2);
    scene.people = [("ana", 1.0), ("bo", 6.0), ("cleo", 11.0)]
        .map(|(name, x)| person(name, place(x)))
        .to_vec();
    let mut mapper = SocialMapper::new(SocialConfig::default()).unwrap();
    mapper.update(noon(), &scene).unwrap();
    scene.people.remove(1);
    let Region { columns, .. } = mapper.update(noon(), &scene).unwrap().dirty;
    assert!(columns.0 > 40 && columns.1 < 80, "{columns:?}");
    scene.people.insert(0, person("dov", place(6.0)));
    let Region { columns, .. } = mapper.update(noon(), &scene).unwrap().dirty;
    assert!(columns.0 > 40 && columns.1 < 80, "{columns:?}");
}

fn any_pose() -> impl Strategy<Value = Isometry2<f64>> {
    (-1.0..13.0, -1.0..11.0, -4.0..4.0).prop_map(|(x, y, heading)| pose(x, y, heading))
}

prop_compose! {
    fn any_people()(all in prop::collection::vec(
        (any_pose(), -2.0..2.0, -2.0..2.0, 0.1..0.4f64), 0..6,
    )) -> Vec<Person> {
        all.into_iter().enumerate().map(|(i, (world_from_person, vx, vy, radius))| Person {
            name: format!("p{i}"),
            world_from_person,
            velocity: Vector2::new(vx, vy),
            radius,
            manner: Manner::default(),
        }).collect()
    }
}

prop_compose! {
    fn any_objects()(all in prop::collection::vec(
        (any_pose(), 0usize..4, any::<bool>(), 0.0..2.0, 0.0..2.0), 0..4,
    )) -> Vec<Object> {
        all.into_iter().enumerate().map(|(i, (world_from_object, class, round, x, y))| Object {
            name: format!("o{i}"),
            class: ["table", "tv", "bed", "plant"][class].to_owned(),
            world_from_object,
            outline: if round { Outline::Circle(x) } else { Outline::Rectangle(Vector2::new(x, y)) },
        }).collect()
    }
}

prop_compose! {
    fn any_scene()(
        people in any_people(),
        objects in any_objects(),
        walls in prop::sample::select(vec![
            vec![],
            vec![wall((3.0, 0.0), (3.0, 10.0)), wall((3.0, 4.0), (9.5, 6.2))],
        ]),
        interactions in prop::collection::vec((0usize..6, 0usize..6), 0..4),
        activities in prop::collection::vec((0usize..4, -4000.0..4000.0, 0.0..2000.0f64), 0..3),
        social in prop::bool::weighted(0.8),
    ) -> SocialScene {
        SocialScene {
            people,
            objects,
            walls,
            interactions: interactions.iter().map(|(a, b)| (format!("p{a}"), format!("p{b}"))).collect(),
            activities: activities.iter().map(|(o, start, length)| Activity {
                name: format!("with {o}"),
                object: format!("o{o}"),
                start: noon() + *start,
                end: noon() + *start + *length,
            }).collect(),
            social,
            ..hall()
        }
    }
}

/// A scene, and how the one before is changed into it: afresh, by one person, by time alone.
#[derive(Debug, Clone)]
enum Turn {
    Another(SocialScene),
    OnePersonMoves(prop::sample::Index, Isometry2<f64>),
    OnePersonLeaves(prop::sample::Index),
    TimePasses(f64),
}

fn any_turn() -> impl Strategy<Value = Turn> {
    prop_oneof![
        any_scene().prop_map(Turn::Another),
        (any::<prop::sample::Index>(), any_pose()).prop_map(|(i, p)| Turn::OnePersonMoves(i, p)),
        any::<prop::sample::Index>().prop_map(Turn::OnePersonLeaves),
        (0.0..3000.0f64).prop_map(Turn::TimePasses),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn updating_equals_drawing_anew(
        start in any_scene(), turns in prop::collection::vec(any_turn(), 1..8),
    ) {
        let (mut scene, mut now) = (start, noon());
        let mut mapper = SocialMapper::new(SocialConfig::default()).unwrap();
        let mut before = mapper.update(now, &scene).unwrap();
        for turn in turns {
            match turn {
                Turn::Another(next) => scene = next,
                Turn::OnePersonMoves(i, to) if !scene.people.is_empty() => {
                    let i = i.index(scene.people.len());
                    scene.people[i].world_from_person = to;
                }
                Turn::OnePersonLeaves(i) if !scene.people.is_empty() => {
                    scene.people.remove(i.index(scene.people.len()));
                }
                Turn::TimePasses(seconds) => now = now + seconds,
                Turn::OnePersonMoves(..) | Turn::OnePersonLeaves(_) => {}
            }
            let updated = mapper.update(now, &scene).unwrap();
            let anew = SocialMapper::new(SocialConfig::default()).unwrap().update(now, &scene).unwrap();
            prop_assert!(updated.grid == anew.grid);
            prop_assert_eq!(&updated.people, &anew.people);
            prop_assert_eq!(&updated.objects, &anew.objects);
            prop_assert_eq!(&updated.rejected, &anew.rejected);
            // What is drawn anew counts as changed even where it looks the same.
            for (index, (was, is)) in before.grid.costs.iter().zip(&updated.grid.costs).enumerate() {
                let (column, row) = (index % updated.grid.width, index / updated.grid.width);
                let cell = Region { columns: (column, column + 1), rows: (row, row + 1) };
                prop_assert!(was.total_cmp(is).is_eq() || cell.meets(&updated.dirty));
            }
            let layer = |layer| mapper.layer(layer).unwrap().costs;
            prop_assert_eq!(&layer(Layer::Master), &updated.grid.costs);
            let (inflation, social) = (layer(Layer::Inflation), layer(Layer::Social));
            let greater = inflation.iter().zip(&social).map(|(a, b)| a.max(*b));
            prop_assert!(greater.eq(updated.grid.costs.iter().copied()));
            prop_assert!(updated.grid.costs.iter().all(|c| *c >= FREE));
            before = updated;
        }
    }

    #[test]
    fn the_grid_and_the_zone_function_agree(people in any_people()) {
        let scene = SocialScene { people, ..hall() };
        let config = SocialConfig { stretch: false, ..SocialConfig::default() };
        let map = SocialMapper::new(config).unwrap().update(noon(), &scene).unwrap();
        let poses: Vec<_> = scene.people.iter().map(|p| p.world_from_person).collect();
        // The grid takes 32 bits: on the edge of a zone itself it may hold to either side.
        let [wider, narrower] = [1.0 - 1e-5, 1.0 + 1e-5].map(|by| {
            let Levels { intimate, personal, social } = Levels::default();
            Proxemics {
                levels: Levels { intimate: intimate * by, personal: personal * by, social: social * by },
                ..Proxemics::default()
            }
        });
        for row in 0..map.grid.height {
            for column in 0..map.grid.width {
                let cell = (column, row);
                let centre = map.grid.centre(cell);
                let touches = scene.people.iter().any(|p| {
                    (position(p) - centre).norm() <= p.radius + scene.robot_radius + 1e-9
                });
                if !touches {
                    let cost = map.grid.cost(cell);
                    prop_assert!(cost <= wider.zone_at(centre, &poses).cost());
                    prop_assert!(cost >= narrower.zone_at(centre, &poses).cost());
                }
            }
        }
    }
}
