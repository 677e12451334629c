//! `cortex replay`: plays a recording again, and tells whether the same graph comes of it.

use super::output::{print, print_json, tell};
use crate::cli::Replay as Arguments;
use crate::progress::Progress;
use crate::recording::{Heap, Item, Live, PlayError, Player, Recording, Target, Verdict, end};
use crate::supervise::{Hold, now};
use crate::{Answer, Failure};
use dsr::Time;
use serde_json::json;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How long it sleeps at a time.
const NAP: Duration = Duration::from_millis(20);

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    let file = arguments.file.as_path();
    let live = arguments.instance.is_some() || arguments.speed.is_some() || arguments.keep;
    let verdict = if live {
        play_live(arguments)?
    } else {
        let interrupted = AtomicBool::new(false);
        play(file, Heap::new(), None, None, &interrupted).map_err(Failure::input)?
    };
    let Some((verdict, is_cut)) = verdict else {
        tell("interrupted: the recording was not played to its end\n");
        return Ok(Answer::No);
    };
    tell_verdict(arguments, &verdict, is_cut)?;
    Ok(if verdict.is_identical() {
        Answer::Yes
    } else {
        Answer::No
    })
}

/// What playing showed, and whether the file was cut off; `None` where it was interrupted.
type Outcome = Option<(Verdict, bool)>;

fn play_live(arguments: &Arguments) -> Result<Outcome, Failure> {
    let name = arguments.instance.as_deref().unwrap_or("default");
    let instance = super::instance(name)?;
    let interrupted = super::interruption()?;
    let _hold = Hold::take(&instance).map_err(Failure::Input)?;
    let progress = Progress::new(&arguments.file.display().to_string(), arguments.json);
    let live = Live::new(instance.clone());
    let mut kept = None;
    let played = play_and_keep(
        &arguments.file,
        live,
        arguments.speed,
        Some(&progress),
        &interrupted,
        &mut kept,
    )
    .map_err(Failure::input)?;
    if arguments.keep && played.is_some() {
        progress.say(&format!("played to its end; `{name}` stays until Ctrl-C"));
        while !interrupted.load(Ordering::Acquire) {
            nap(NAP);
        }
    }
    // The graph goes before the hold on its instance.
    drop(kept);
    Ok(played)
}

fn play<T: Target>(
    file: &Path,
    target: T,
    speed: Option<f64>,
    progress: Option<&Progress>,
    interrupted: &AtomicBool,
) -> Result<Outcome, PlayError> {
    play_and_keep(file, target, speed, progress, interrupted, &mut None)
}

/// Plays a recording; what it was played into is left in `kept`.
fn play_and_keep<T: Target>(
    file: &Path,
    target: T,
    speed: Option<f64>,
    progress: Option<&Progress>,
    interrupted: &AtomicBool,
    kept: &mut Option<T>,
) -> Result<Outcome, PlayError> {
    let end = match progress {
        Some(_) => end(file)?,
        None => Time::default(),
    };
    let mut recording = Recording::open(file)?;
    let mut player = Player::new(target);
    let mut pace: Option<(Time, Instant)> = None;
    while let Some(item) = recording.next()? {
        if let Some(time) = item.time() {
            let (start, began) = *pace.get_or_insert_with(|| (time, now()));
            if let Some(speed) = speed {
                wait(began, time.since(start) / speed, interrupted);
            }
            if let Some(progress) = progress {
                let what = matches!(item, Item::Commit { .. }).then_some("");
                progress.at(time.since(start), end.since(start), what.unwrap_or("graph"));
            }
        }
        if interrupted.load(Ordering::Acquire) {
            return Ok(None);
        }
        player.play(&item)?;
    }
    let verdict = player.verdict().clone();
    if verdict.digests == 0 {
        return Err(PlayError::NoGraph);
    }
    *kept = Some(player.target);
    Ok(Some((verdict, recording.is_cut())))
}

/// Waits until so many seconds after `began`.
fn wait(began: Instant, seconds: f64, interrupted: &AtomicBool) {
    let due = began + Duration::from_secs_f64(seconds.max(0.0));
    while !interrupted.load(Ordering::Acquire) {
        let left = due.saturating_duration_since(now());
        if left.is_zero() {
            return;
        }
        nap(left.min(NAP));
    }
}

#[allow(
    clippy::disallowed_methods,
    reason = "a recording is played at the pace that was asked for"
)]
fn nap(time: Duration) {
    std::thread::sleep(time);
}

fn tell_verdict(arguments: &Arguments, verdict: &Verdict, is_cut: bool) -> Result<(), Failure> {
    if arguments.json {
        let mismatches = verdict.mismatches.iter().map(|wrong| {
            json!({"version": wrong.version, "recorded": wrong.recorded, "replayed": wrong.replayed})
        });
        return print_json(&json!({
            "file": arguments.file.display().to_string(), "identical": verdict.is_identical(),
            "cut": is_cut, "complete": verdict.ended, "commits": verdict.commits,
            "version": verdict.version, "compared": verdict.compared,
            "digests": verdict.digests, "missed": verdict.missed,
            "ticks": verdict.ticks, "messages": verdict.messages,
            "mismatches": mismatches.collect::<Vec<_>>(),
        }));
    }
    print(&format!(
        "{} commits played, up to version {}; the graph was compared {} times\n",
        verdict.commits, verdict.version, verdict.digests
    ))?;
    if verdict.missed > 0 {
        print(&format!(
            "commits are missing from the recording in {} places; it has the graph after each\n",
            verdict.missed
        ))?;
    }
    if is_cut {
        print(&format!(
            "the file was cut off: its recorder did not end it; the last comparison is of version {}\n",
            verdict.compared
        ))?;
    }
    for wrong in &verdict.mismatches {
        print(&format!(
            "version {}: recorded {}, replayed {}\n",
            wrong.version, wrong.recorded, wrong.replayed
        ))?;
    }
    print(match (verdict.is_identical(), verdict.ended) {
        (true, true) => "the final graph is identical\n",
        (true, false) => "identical as far as the recording says\n",
        (false, _) => "not identical\n",
    })
}
