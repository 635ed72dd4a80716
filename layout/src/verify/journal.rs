//! The history of an edited file: every journal page from the newest commit to the first, and each state that they name (`states`).
//!
//! Cost: a read a commit, and what `states` takes.

use super::Findings;
use super::states::States;
use crate::error::LayoutError;
use crate::file::header::{Header, History};
use crate::file::journal::{Commit, State};
use crate::read::terrain::Terrain;

/// A commit and the journal page it is on.
type Listed = (u32, Commit);

/// What is wrong with the journal and the states that it leads to.
pub(super) fn check(terrain: &Terrain) -> Result<Findings, LayoutError> {
    let mut findings = Findings::default();
    let header = terrain.header();
    let Some(history) = header.history else { return Ok(findings) };
    let commits = chain(terrain, history, &mut findings)?;
    let Some((_, newest)) = commits.first() else { return Ok(findings) };
    relations(header, history, &commits, &mut findings);
    let mut states = States::of(terrain)?;
    for (page, _) in &commits {
        states.take_journal(*page, &mut findings);
    }
    for (page, commit) in &commits {
        let name = format!("after commit {} (journal on file page {page})", commit.sequence);
        states.look_at(name, &commit.state, &mut findings)?;
    }
    states.look_at("before all commits".into(), &newest.original, &mut findings)?;
    states.read_pages(&mut findings)?;
    Ok(findings)
}

/// Journal pages from the newest commit to the first, as far as they are sound. Each lies before the one after it, so the chain ends.
fn chain(terrain: &Terrain, history: History, findings: &mut Findings) -> Result<Vec<Listed>, LayoutError> {
    let mut commits = Vec::new();
    let mut at = history.tip_page;
    while at != 0 {
        match Commit::read(terrain.source(), terrain.header(), at) {
            Ok(commit) => {
                let parent = commit.parent;
                commits.push((at, commit));
                at = parent;
            }
            Err(error) => {
                note(findings, "", error)?;
                break;
            }
        }
    }
    Ok(commits)
}

/// Whether journal pages and header say the same of what they have in common.
fn relations(header: &Header, history: History, commits: &[Listed], findings: &mut Findings) {
    let Some((tip, newest)) = commits.first() else { return };
    let mut add = |page: u32, problem: &str| {
        findings.add(format!("journal (file page {page})"), problem);
    };
    for (i, (page, commit)) in commits.iter().enumerate() {
        let parent = commits.get(i + 1).map(|(_, parent)| parent.sequence);
        let is_last_read = parent.is_none() && commit.parent != 0;
        if !is_last_read && commit.sequence != parent.unwrap_or(0).saturating_add(1) {
            add(*page, "its sequence does not follow its parent's");
        }
        if commit.original != newest.original {
            add(*page, "it names another state before all commits than the newest commit does");
        }
    }
    let here = State::of(header);
    let state = match history.commit_page {
        0 => Some(&newest.original),
        at => commits.iter().find(|(page, _)| *page == at).map(|(_, commit)| &commit.state),
    };
    match state {
        None => add(*tip, "it does not lead to the commit that the header says the file is at"),
        Some(state) if *state != here => {
            add(
                history.commit_page.max(1),
                "the header names another state than it does for the same commit",
            );
        }
        Some(_) => {}
    }
}

/// Adds what is damaged to the findings; other errors are the caller's.
fn note(findings: &mut Findings, of: &str, error: LayoutError) -> Result<(), LayoutError> {
    match error {
        LayoutError::Damaged { place, problem, .. } => {
            findings.add(format!("{of}{place}"), problem);
            Ok(())
        }
        other => Err(other),
    }
}
