//! A stream cut into blocks between words or lines. All threads work on blocks, and results are taken in order.
//!
//! While a batch of blocks is worked on, the results of the batch before are taken. Invariant: the blocks joined are the stream, and no word (or line) is in two of them.

use rayon::prelude::*;
use std::io::Read;
use std::path::Path;

use super::number::is_blank;
use terrasoar_layout::error::LayoutError;

/// Bytes of a block, about.
const BLOCK_BYTES: usize = 1 << 18;

/// Where a stream may be cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Cut {
    Words,
    Lines,
}

impl Cut {
    fn is_here(self, byte: u8) -> bool {
        match self {
            Self::Words => is_blank(byte),
            Self::Lines => byte == b'\n' || byte == b'\r',
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Words => "blank",
            Self::Lines => "end of a line",
        }
    }
}

/// Works on the blocks of `stream`, which is the rest of the file at `path`, and takes what comes of them in order.
///
/// # Errors
/// I/O; damage where [`BLOCK_BYTES`] bytes have no place to cut; what `take` refuses, after which no block is read.
pub(crate) fn each_block<T: Send>(
    path: &Path,
    stream: &mut (impl Read + Send),
    cut: Cut,
    work: impl Fn(&[u8]) -> T + Sync,
    mut take: impl FnMut(T) -> Result<(), LayoutError> + Send,
) -> Result<(), LayoutError> {
    let at_once = rayon::current_num_threads().max(1);
    let mut cutter = Cutter { path, stream, cut, rest: Vec::new(), is_over: false };
    let mut done: Vec<T> = Vec::new();
    loop {
        let next = || {
            let blocks = cutter.next(at_once)?;
            Ok::<Vec<T>, LayoutError>(blocks.par_iter().map(|block| work(block)).collect())
        };
        let taken = std::mem::take(&mut done);
        let (next, took) = rayon::join(next, || taken.into_iter().try_for_each(&mut take));
        took?;
        done = next?;
        if done.is_empty() {
            return Ok(());
        }
    }
}

struct Cutter<'a, R> {
    path: &'a Path,
    stream: &'a mut R,
    cut: Cut,
    /// What was read and belongs to the next block.
    rest: Vec<u8>,
    is_over: bool,
}

impl<R: Read> Cutter<'_, R> {
    /// Up to `most` blocks; none at the end of the stream.
    fn next(&mut self, most: usize) -> Result<Vec<Vec<u8>>, LayoutError> {
        let mut blocks = Vec::new();
        while blocks.len() < most && !self.is_over {
            let block = self.block()?;
            if !block.is_empty() {
                blocks.push(block);
            }
        }
        Ok(blocks)
    }

    fn block(&mut self) -> Result<Vec<u8>, LayoutError> {
        let mut block = std::mem::take(&mut self.rest);
        let wanted = BLOCK_BYTES.saturating_sub(block.len()).max(1);
        block.reserve_exact(wanted);
        let read = self
            .stream
            .by_ref()
            .take(wanted as u64)
            .read_to_end(&mut block)
            .map_err(|source| LayoutError::io(self.path, "cannot read the file", source))?;
        if read < wanted {
            self.is_over = true;
            return Ok(block);
        }
        let Some(last) = block.iter().rposition(|byte| self.cut.is_here(*byte)) else {
            return Err(LayoutError::damaged(
                self.path,
                "numbers",
                format!(
                    "{BLOCK_BYTES} bytes follow each other without a {}, so this is no text of numbers; fetch the file again",
                    self.cut.name()
                ),
            ));
        };
        self.rest = block.split_off(last + 1);
        Ok(block)
    }
}

#[cfg(test)]
mod tests {
    use super::super::number::words;
    use super::*;

    fn collected(text: &[u8], cut: Cut) -> Result<Vec<Vec<Vec<u8>>>, LayoutError> {
        let mut all = Vec::new();
        let work = |block: &[u8]| words(block).map(<[u8]>::to_vec).collect::<Vec<_>>();
        each_block(Path::new("a"), &mut &text[..], cut, work, |block| {
            all.push(block);
            Ok(())
        })?;
        Ok(all)
    }

    #[test]
    fn blocks_joined_are_the_text() {
        for count in [0usize, 1, 7, 40_000, 200_000, 600_000] {
            let text: String =
                (0..count).map(|i| format!("{i}{}", if i % 10 == 9 { "\r\n" } else { "  " })).collect();
            let blocks = collected(text.as_bytes(), Cut::Words).unwrap();
            let flat: Vec<String> =
                blocks.iter().flatten().map(|word| String::from_utf8(word.clone()).unwrap()).collect();
            assert!(flat.iter().enumerate().all(|(i, word)| *word == i.to_string()) && flat.len() == count);
            for line in collected(text.as_bytes(), Cut::Lines).unwrap() {
                assert!(line.len() % 10 == 0 || count % 10 != 0, "{count}");
            }
        }
    }

    #[test]
    fn a_text_without_blanks_is_refused_and_errors_stop() {
        let said = collected(&vec![b'1'; 3 * BLOCK_BYTES], Cut::Words).unwrap_err().to_string();
        assert!(said.contains("without a blank"), "{said}");
        assert_eq!(collected(&vec![b'1'; 3000], Cut::Words).unwrap().len(), 1);
        let text = "1 ".repeat(1 << 20);
        let mut taken = 0;
        let stopped = each_block(
            Path::new("a"),
            &mut text.as_bytes(),
            Cut::Words,
            |block| block.len(),
            |_| {
                taken += 1;
                if taken == 2 { Err(LayoutError::Usage("enough".into())) } else { Ok(()) }
            },
        );
        assert_eq!((stopped.unwrap_err().to_string().as_str(), taken), ("enough", 2));
    }
}
