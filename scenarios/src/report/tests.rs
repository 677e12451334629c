//! The text of reports, and what they make of missing figures.

use super::*;
use crate::metrics::{PersonMetrics, Psi, RobotMetrics};
use crate::world::Collisions;
use expect_test::expect;
use serde_json::{Value, json};

fn metrics(path_length: f64, people: &[(&str, f64)], shares: [f64; 5], bumps: u64) -> Metrics {
    let [intimate, personal, social, public, objects] = shares;
    let psi = Psi {
        intimate,
        personal,
        social,
        public,
        objects,
    };
    let collisions_by_kind = Collisions {
        people: bumps,
        ..Collisions::default()
    };
    Metrics {
        robot: Some(RobotMetrics {
            path_length,
            duration: 3.0 * path_length,
            chc: 1.75,
            collisions: collisions_by_kind.total(),
            collisions_by_kind,
        }),
        motion: None,
        company: None,
        people: people
            .iter()
            .map(|(name, min_distance)| PersonMetrics {
                name: (*name).to_owned(),
                min_distance: *min_distance,
                min_clearance: min_distance - 0.45,
            })
            .collect(),
        psi: Some(psi),
        psi_moving: None,
    }
}

fn mission(name: &str, status: &str, reason: Option<&str>) -> MissionOutcome {
    MissionOutcome {
        name: name.to_owned(),
        goal: "{ robot:robot anna:person } { }".to_owned(),
        status: status.to_owned(),
        reason: reason.map(str::to_owned),
    }
}

fn report() -> Report {
    Report {
        format: FORMAT,
        scenario: "care-centre".to_owned(),
        seed: 7,
        social: true,
        base: "differential",
        success: true,
        timed_out: false,
        shortest_path: Some(12.5),
        spl: Some(0.89),
        mission: MissionReport::of(vec![mission("visit", "succeeded", None)]),
        metrics: metrics(
            14.03,
            &[("anna", 1.39), ("ben", 2.14)],
            [0.0, 8.0, 11.0, 81.0, 1.64],
            0,
        ),
        plan: vec![StepReport {
            mission: "invite".to_owned(),
            rule: "changeRoom".to_owned(),
            binding: BTreeMap::from([("r".to_owned(), "robot".to_owned())]),
            status: "done".to_owned(),
        }],
        replans: 2,
        agents: vec![AgentReport {
            name: "navigation".to_owned(),
            restarts: 1,
            cpu_seconds: None,
        }],
        baseline: None,
    }
}

#[test]
fn the_table_compares_the_run_with_and_without_social_behaviour() {
    let mut report = report();
    report.baseline = Some(Baseline {
        success: false,
        spl: Some(0.0),
        metrics: metrics(
            12.81,
            &[("anna", 0.51), ("cleo", 4.0)],
            [4.2, 1.0, 12.4, 82.4, 35.0],
            1,
        ),
    });
    expect![[r"
        care-centre, seed 7: mission succeeded

                                                             social behaviour   no social behaviour
        mission                                                     succeeded                failed
        path length                                   m                 14.03                 12.81
        duration                                      s                  42.1                  38.4
        heading changes (CHC, every 0.2 m)            rad                1.75                  1.75
        collisions (walls, objects, people)                       0 (0, 0, 0)           1 (0, 0, 1)
        success weighted by path length (SPL)                            0.89                  0.00
        mean speed (greatest)                         m/s                   -                     -
        mean acceleration (greatest)                  m/s2                  -                     -
        mean jerk (greatest)                          m/s3                  -                     -
        stalled                                       s                     -                     -
        distance to the nearest, mean (least)         m                     -                     -
        the same between surfaces                     m                     -                     -
        least time to a collision                     s                     -                     -
        share of time with 0.5 m of space for all     %                     -                     -
        share of time between the members of a group  %                     -                     -
        share of time in
          intimate zone                               %                   0.0                   4.2
          personal zone                               %                   8.0                   1.0
          social zone                                 %                  11.0                  12.4
          public space                                %                  81.0                  82.4
          space of an object in use                   %                   1.6                  35.0
        share of moving time (over 0.05 m/s) in
          intimate zone                               %                     -                     -
          personal zone                               %                     -                     -
          social zone                                 %                     -                     -
          public space                                %                     -                     -
          space of an object in use                   %                     -                     -
        least distance of centres (of surfaces)
          anna                                        m           1.39 (0.94)           0.51 (0.06)
          ben                                         m           2.14 (1.69)                     -
          cleo                                        m                     -           4.00 (3.55)
    "]]
    .assert_eq(&report.table());
}

#[test]
fn a_crowd_is_cut_to_the_closest() {
    let mut report = report();
    let names: Vec<String> = (0..12).map(|i| format!("walker_{i}")).collect();
    let crowd: Vec<(&str, f64)> = names
        .iter()
        .enumerate()
        .map(|(i, name)| (name.as_str(), 5.0 - 0.25 * i as f64))
        .collect();
    report.metrics = metrics(9.0, &crowd, [0.0, -0.0, 0.0, 100.0, f64::NAN], 0);
    report.success = false;
    report.mission = MissionReport::of(vec![
        mission("greet", "succeeded", None),
        mission("visit", "failed", Some("anna left")),
        mission("return", "queued", None),
    ]);
    expect![[r"
        care-centre, seed 7: mission visit failed: anna left

                                                             social behaviour
        mission                                                        failed
        path length                                   m                  9.00
        duration                                      s                  27.0
        heading changes (CHC, every 0.2 m)            rad                1.75
        collisions (walls, objects, people)                       0 (0, 0, 0)
        success weighted by path length (SPL)                            0.89
        mean speed (greatest)                         m/s                   -
        mean acceleration (greatest)                  m/s2                  -
        mean jerk (greatest)                          m/s3                  -
        stalled                                       s                     -
        distance to the nearest, mean (least)         m                     -
        the same between surfaces                     m                     -
        least time to a collision                     s                     -
        share of time with 0.5 m of space for all     %                     -
        share of time between the members of a group  %                     -
        share of time in
          intimate zone                               %                   0.0
          personal zone                               %                   0.0
          social zone                                 %                   0.0
          public space                                %                 100.0
          space of an object in use                   %                     -
        share of moving time (over 0.05 m/s) in
          intimate zone                               %                     -
          personal zone                               %                     -
          social zone                                 %                     -
          public space                                %                     -
          space of an object in use                   %                     -
        least distance of centres (of surfaces)
          walker_11                                   m           2.25 (1.80)
          walker_10                                   m           2.50 (2.05)
          walker_9                                    m           2.75 (2.30)
          walker_8                                    m           3.00 (2.55)
          walker_7                                    m           3.25 (2.80)
          walker_6                                    m           3.50 (3.05)
          walker_5                                    m           3.75 (3.30)
          walker_4                                    m           4.00 (3.55)
          and 4 more, none closer than 4.25 m
    "]]
    .assert_eq(&report.table());
}

#[test]
fn a_run_that_recorded_nothing_has_a_table_of_dashes() {
    let mut report = report();
    report.metrics = Metrics::default();
    report.mission = None;
    report.social = false;
    expect![[r"
        care-centre, seed 7: no mission

                                                             no social behaviour
        mission                                                                -
        path length                                   m                        -
        duration                                      s                        -
        heading changes (CHC, every 0.2 m)            rad                      -
        collisions (walls, objects, people)                                    -
        success weighted by path length (SPL)                               0.89
        mean speed (greatest)                         m/s                      -
        mean acceleration (greatest)                  m/s2                     -
        mean jerk (greatest)                          m/s3                     -
        stalled                                       s                        -
        distance to the nearest, mean (least)         m                        -
        the same between surfaces                     m                        -
        least time to a collision                     s                        -
        share of time with 0.5 m of space for all     %                        -
        share of time between the members of a group  %                        -
        share of time in
          intimate zone                               %                        -
          personal zone                               %                        -
          social zone                                 %                        -
          public space                                %                        -
          space of an object in use                   %                        -
        share of moving time (over 0.05 m/s) in
          intimate zone                               %                        -
          personal zone                               %                        -
          social zone                                 %                        -
          public space                                %                        -
          space of an object in use                   %                        -
    "]]
    .assert_eq(&report.table());
}

#[test]
fn the_json_has_the_fields_that_are_promised() {
    let text = report().to_json().unwrap();
    expect![[r#"
        {
          "format": "report/1",
          "scenario": "care-centre",
          "seed": 7,
          "social": true,
          "base": "differential",
          "success": true,
          "timed_out": false,
          "shortest_path": 12.5,
          "spl": 0.89,
          "mission": {
            "name": "visit",
            "goal": "{ robot:robot anna:person } { }",
            "status": "succeeded",
            "reason": null,
            "missions": [
              {
                "name": "visit",
                "goal": "{ robot:robot anna:person } { }",
                "status": "succeeded",
                "reason": null
              }
            ]
          },
          "robot": {
            "path_length": 14.03,
            "duration": 42.089999999999996,
            "chc": 1.75,
            "collisions": 0,
            "collisions_by_kind": {
              "walls": 0,
              "objects": 0,
              "people": 0
            }
          },
          "motion": null,
          "company": null,
          "people": [
            {
              "name": "anna",
              "min_distance": 1.39,
              "min_clearance": 0.94
            },
            {
              "name": "ben",
              "min_distance": 2.14,
              "min_clearance": 1.6900000000000002
            }
          ],
          "psi": {
            "intimate": 0.0,
            "personal": 8.0,
            "social": 11.0,
            "public": 81.0,
            "objects": 1.64
          },
          "psi_moving": null,
          "plan": [
            {
              "mission": "invite",
              "rule": "changeRoom",
              "binding": {
                "r": "robot"
              },
              "status": "done"
            }
          ],
          "replans": 2,
          "agents": [
            {
              "name": "navigation",
              "restarts": 1,
              "cpu_seconds": null
            }
          ],
          "baseline": null
        }
    "#]]
    .assert_eq(&text);
}

#[test]
fn what_is_not_finite_or_does_not_apply_is_null() {
    let mut report = report();
    report.metrics.people[0].min_clearance = f64::INFINITY;
    report.metrics.psi.as_mut().unwrap().objects = f64::NAN;
    report.agents[0].cpu_seconds = Some(f64::NAN);
    report.mission = MissionReport::of(Vec::new());
    let json: Value = serde_json::from_str(&report.to_json().unwrap()).unwrap();
    let nulls = [
        "/people/0/min_clearance",
        "/psi/objects",
        "/psi_moving",
        "/mission",
        "/baseline",
        "/agents/0/cpu_seconds",
    ];
    for path in nulls {
        assert_eq!(json.pointer(path), Some(&Value::Null), "{path}");
    }
    report.metrics = Metrics::default();
    let json: Value = serde_json::from_str(&report.to_json().unwrap()).unwrap();
    assert_eq!(json["robot"], Value::Null);
    assert_eq!(json["people"], json!([]));
}

#[test]
fn the_first_mission_that_did_not_succeed_decides() {
    let done = || mission("greet", "succeeded", None);
    let mixed = MissionReport::of(vec![done(), mission("visit", "failed", None), done()]).unwrap();
    assert_eq!(
        (mixed.decisive().name.as_str(), mixed.succeeded()),
        ("visit", false)
    );
    assert_eq!(mixed.missions().len(), 3);
    let good = MissionReport::of(vec![mission("visit", "succeeded", None), done()]).unwrap();
    assert_eq!(
        (good.decisive().name.as_str(), good.succeeded()),
        ("greet", true)
    );
}
