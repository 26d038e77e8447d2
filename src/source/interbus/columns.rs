//! Where the words of each device stand in a row of process words.

use super::layout::{Layout, Mapping, Place};
use super::table::{Cells, Header};
use super::words::Words;
use dissectors::interbus::Device;

/// What a header looks like that tells all.
const FORMS: &str = "time,out,in or time,out1,out2,in1,in2, and device where there are several";

/// How columns are mapped that have other names.
const MAPPING: &str = "say which is which, such as --columns time=Timestamp,out=QD10,in=4 (a name, \
                       or a number from 1), for several devices in a row --ring-map \
                       1=QD10/ID10,2=QW20+QW22/IW20+IW22";

/// The columns of a table of process words, from 0.
pub struct Columns {
    /// The date, where it is apart from the time.
    pub date: Option<usize>,
    /// The time, if there is one.
    pub time: Option<usize>,
    /// The device, where a row says which it is of.
    pub device: Option<usize>,
    /// The words of each device in a row.
    pub members: Vec<Member>,
}

/// The words of one device in a row.
pub struct Member {
    /// The device, where no column says so.
    pub device: Device,
    /// Master to device.
    pub out: Option<Site>,
    /// Device to master.
    pub input: Option<Site>,
}

impl Member {
    /// Its words in a row: what the master sends, and what it receives.
    pub fn sides(
        &self,
        cells: Cells<'_>,
        words: &Words,
    ) -> Result<(Option<u32>, Option<u32>), &'static str> {
        let side = |site: Option<Site>| site.map_or(Ok(None), |site| site.word(cells, words));
        Ok((side(self.out)?, side(self.input)?))
    }
}

/// Where a word of 32 bits stands.
#[derive(Clone, Copy)]
pub enum Site {
    /// In one column.
    One(usize),
    /// In two, of 16 bits each.
    Two(usize, usize),
}

impl Site {
    /// The word there; `None` where nothing stands.
    pub fn word(self, cells: Cells<'_>, words: &Words) -> Result<Option<u32>, &'static str> {
        let cell = |column| cells.get(column).ok_or("columns are missing");
        let word = match self {
            Site::One(column) => match cell(column)? {
                b"" => return Ok(None),
                cell => words.long(cell),
            },
            Site::Two(first, second) => match (cell(first)?, cell(second)?) {
                (b"", b"") => return Ok(None),
                (first, second) => words.pair(first, second),
            },
        };
        word.map(Some).ok_or(words.wrong())
    }
}

impl Columns {
    /// Those of a table with this header.
    ///
    /// # Errors
    /// There are no words in it, or a column that the user named is not there.
    pub fn of(header: &Header, mapping: &Mapping, layout: &Layout) -> Result<Columns, String> {
        let find = |name| header.find(name, mapping);
        let members = match layout.ring.0.as_slice() {
            [] => vec![Member {
                device: Device::FIRST,
                out: site(header, mapping, ["out", "out1", "out2"])?,
                input: site(header, mapping, ["in", "in1", "in2"])?,
            }],
            ring => {
                let place = |place: &Option<Place>| place.as_ref().map(|it| at(header, it));
                let members = ring.iter().map(|member| {
                    let out = place(&member.out).transpose()?;
                    let input = place(&member.input).transpose()?;
                    Ok(Member { device: member.device, out, input })
                });
                members.collect::<Result<_, String>>()?
            }
        };
        if members.iter().all(|member| member.out.is_none() && member.input.is_none()) {
            let told = header.told();
            return Err(format!(
                "no column is named out or in: {told}; expected {FORMS}; {MAPPING}"
            ));
        }
        let columns =
            Columns { date: find("date")?, time: find("time")?, device: find("device")?, members };
        let has_time = columns.time.is_some() || mapping.column("time").is_some();
        let is_mapped = layout.is_by_number() || !layout.ring.0.is_empty();
        match has_time || is_mapped {
            true => Ok(columns),
            false => Err(format!("no column is named time: {}; {MAPPING}", header.told())),
        }
    }

    /// The word cells of a row.
    pub fn cells<'a>(&self, cells: Cells<'a>) -> impl Iterator<Item = &'a [u8]> {
        let sites = self.members.iter().flat_map(|member| [member.out, member.input]).flatten();
        let columns = sites.flat_map(|site| match site {
            Site::One(column) => [Some(column), None],
            Site::Two(first, second) => [Some(first), Some(second)],
        });
        columns.flatten().filter_map(move |column| cells.get(column))
    }
}

/// The columns of one side: one of 32 bits, or two of 16.
fn site(header: &Header, mapping: &Mapping, names: [&str; 3]) -> Result<Option<Site>, String> {
    let [whole, first, second] = names.map(|name| header.find(name, mapping));
    Ok(match (whole?, first?, second?) {
        (Some(column), _, _) => Some(Site::One(column)),
        (None, Some(first), Some(second)) => Some(Site::Two(first, second)),
        (None, None, None) => None,
        _ => {
            return Err(format!(
                "{} and {} belong together: {}",
                names[1],
                names[2],
                header.told()
            ));
        }
    })
}

fn at(header: &Header, Place(first, second): &Place) -> Result<Site, String> {
    let first = header.place(first)?;
    Ok(match second {
        Some(second) => Site::Two(first, header.place(second)?),
        None => Site::One(first),
    })
}
