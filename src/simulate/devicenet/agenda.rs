//! What a node has to do, and when.

use crate::simulate::time::Ps;

/// Tasks with their times.
pub struct Agenda<T> {
    tasks: Vec<(Ps, T)>,
}

impl<T: Copy + PartialEq> Agenda<T> {
    /// Nothing to do.
    pub fn new() -> Self {
        Agenda { tasks: Vec::new() }
    }

    /// This is to be done then.
    pub fn add(&mut self, at: Ps, task: T) {
        self.tasks.push((at, task));
    }

    /// This is to be done then and at no other time.
    pub fn set(&mut self, at: Ps, task: T) {
        self.cancel(task);
        self.add(at, task);
    }

    /// This is not to be done any more.
    pub fn cancel(&mut self, task: T) {
        self.tasks.retain(|(_, other)| *other != task);
    }

    /// Nothing is to be done any more.
    pub fn clear(&mut self) {
        self.tasks.clear();
    }

    /// When there is something to do next.
    pub fn next(&self) -> Ps {
        self.tasks.iter().map(|(at, _)| *at).min().unwrap_or(Ps::MAX)
    }

    /// What is to be done by now, the earliest first.
    pub fn due(&mut self, now: Ps) -> Option<T> {
        let times = self.tasks.iter().enumerate().filter(|(_, (at, _))| *at <= now);
        let (first, _) = times.min_by_key(|(index, (at, _))| (*at, *index))?;
        Some(self.tasks.remove(first).1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tasks_come_due_in_order() {
        let mut agenda = Agenda::new();
        agenda.add(30, 'c');
        agenda.add(10, 'a');
        agenda.add(10, 'b');
        agenda.set(20, 'c');
        assert_eq!(agenda.next(), 10);
        assert_eq!((agenda.due(9), agenda.due(15), agenda.due(15)), (None, Some('a'), Some('b')));
        assert_eq!((agenda.due(15), agenda.due(25), agenda.next()), (None, Some('c'), Ps::MAX));
    }
}
