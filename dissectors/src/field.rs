//! Fields: what a record can be asked for, declared once per protocol and used by every export.

/// Which field of a protocol's table is meant: its index there.
pub type FieldId = usize;

/// One thing that a record may hold.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// Its name in filters, columns and reports. Dots separate the objects it stands in:
    /// `slin.position` is the key `position` of the object `slin`, `devicenet.error.name` the key
    /// `name` of the object `error` in the object `devicenet`.
    pub name: &'static str,
    /// What kind of value it is.
    pub kind: Kind,
    /// The unit of a number, or `""`.
    pub unit: &'static str,
    /// One sentence for people.
    pub meaning: &'static str,
    /// What it stands for in any protocol.
    pub role: Role,
}

impl Field {
    /// The key inside its object: the name after the last dot.
    #[must_use]
    pub fn key(&self) -> &'static str {
        self.name.rsplit_once('.').map_or(self.name, |(_, key)| key)
    }

    /// The object it stands in at this depth: of `a.b.c`, `a` and then `b`. `None` where the key
    /// is.
    #[must_use]
    pub fn object(&self, depth: usize) -> Option<&'static str> {
        let mut parts = self.name.split('.').skip(depth);
        let part = parts.next()?;
        parts.next().map(|_| part)
    }

    /// Whether another field stands in the same object at this depth.
    #[must_use]
    pub fn shares_object(&self, other: &Field, depth: usize) -> bool {
        self.object(depth).is_some_and(|object| other.object(depth) == Some(object))
    }
}

/// What a field stands for, whatever the protocol calls it. Statistics and tables find their
/// numbers by it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Role {
    /// Nothing that other rooms need to know.
    Plain,
    /// The measured position.
    Position,
    /// Time from a request to its answer.
    ResponseTime,
    /// Number of the record that asked.
    Request,
    /// What is asked for, by name.
    Service,
    /// Who sent it.
    Source,
    /// Who it is for.
    Destination,
}

impl Role {
    /// How many there are.
    const COUNT: usize = Role::Destination as usize + 1;
}

/// The first field with each role, among those of a protocol.
#[derive(Clone, Copy, Debug)]
pub struct Roles([Option<FieldId>; Role::COUNT]);

impl Roles {
    /// Those of these fields.
    #[must_use]
    pub const fn of(fields: &[Field]) -> Self {
        let mut roles = [None; Role::COUNT];
        let mut field = fields.len();
        while field > 0 {
            field -= 1;
            roles[fields[field].role as usize] = Some(field);
        }
        Roles(roles)
    }

    /// The field with this role.
    #[must_use]
    pub const fn field(&self, role: Role) -> Option<FieldId> {
        self.0[role as usize]
    }
}

/// The kind of a field's value.
#[derive(Clone, Copy, Debug)]
pub enum Kind {
    /// `true` or `false`.
    Bool,
    /// A whole number between two bounds, both included.
    Int(i64, i64),
    /// A number with a fraction.
    Float,
    /// Free text.
    Text,
    /// One of these words.
    OneOf(&'static [&'static str]),
    /// Words of the list joined by `+`, or `none`.
    AnyOf(&'static [&'static str]),
    /// A byte as two hex digits (three, where a character has nine data bits).
    Byte,
    /// Bytes as hex digits.
    Hex,
    /// Rows, each with these fields.
    Rows(&'static [Field]),
    /// Several values of this kind.
    List(&'static Kind),
    /// A value whose kind depends on what is asked for: a truth, a number, text, or a list.
    Any,
}

/// The value of a field in one record.
#[derive(Clone, Copy)]
pub enum Value<'a> {
    /// The field does not apply to this record.
    Absent,
    /// A truth.
    Bool(bool),
    /// A whole number.
    Int(i64),
    /// A number with a fraction.
    Float(f64),
    /// A word or sentence.
    Text(&'a str),
    /// One character.
    Byte(u16),
    /// Bytes.
    Hex(&'a [u8]),
    /// Rows of values.
    Rows(&'a dyn Rows),
    /// Several values.
    List(&'a dyn List),
}

impl Value<'_> {
    /// Whether the field does not apply.
    #[must_use]
    pub const fn is_absent(&self) -> bool {
        matches!(self, Value::Absent)
    }
}

impl From<Option<i64>> for Value<'_> {
    fn from(value: Option<i64>) -> Self {
        value.map_or(Value::Absent, Value::Int)
    }
}

impl<'a> From<Option<&'a str>> for Value<'a> {
    fn from(value: Option<&'a str>) -> Self {
        value.map_or(Value::Absent, Value::Text)
    }
}

/// A list of values inside a record.
pub trait List {
    /// How many values.
    fn len(&self) -> usize;

    /// Whether there is none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The value at this place; [`Value::Absent`] outside the list.
    fn get(&self, index: usize) -> Value<'_>;
}

impl List for [&'static str] {
    fn len(&self) -> usize {
        <[&'static str]>::len(self)
    }

    fn get(&self, index: usize) -> Value<'_> {
        <[&'static str]>::get(self, index).copied().into()
    }
}

/// A list of rows inside a record.
pub trait Rows {
    /// How many rows.
    fn len(&self) -> usize;

    /// Whether there is none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The value of a field in a row; [`Value::Absent`] outside the list.
    fn get(&self, row: usize, field: FieldId) -> Value<'_>;
}

/// The fields of a medium followed by those of a protocol on it, as one table.
#[must_use]
pub const fn joined<const N: usize>(first: &[Field], second: &[Field]) -> [Field; N] {
    assert!(first.len() + second.len() == N, "the table has another size");
    let mut all = [first[0]; N];
    let mut index = 0;
    while index < N {
        let own = index.checked_sub(first.len());
        all[index] = match own {
            Some(own) => second[own],
            None => first[index],
        };
        index += 1;
    }
    all
}

/// Declares a protocol's table of fields, each with how a record answers it: the static table, and
/// the layer's `value` method that goes with it.
macro_rules! fields {
    ($(#[$meta:meta])* $vis:vis static $table:ident of $layer:ident {
        $($name:literal ($kind:expr, $unit:literal, $role:ident) $meaning:literal
            => |$this:ident| $value:expr;)*
    }) => {
        $(#[$meta])*
        $vis static $table: &[$crate::field::Field] = &[$($crate::field::Field {
            name: $name,
            kind: $kind,
            unit: $unit,
            meaning: $meaning,
            role: $crate::field::Role::$role,
        }),*];

        impl $layer<'_> {
            pub(crate) fn value(
                &self,
                field: $crate::field::FieldId,
            ) -> $crate::field::Value<'_> {
                type Answer = for<'a> fn(&'a $layer<'_>) -> $crate::field::Value<'a>;
                const ANSWERS: &[Answer] = &[$(|$this| $value),*];
                ANSWERS.get(field).map_or($crate::field::Value::Absent, |answer| answer(self))
            }
        }
    };
}
pub(crate) use fields;
