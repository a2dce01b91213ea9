//! Frames as statements state them: `$TOOL`, `$BASE`, `BAS(..)`, motion data, and what stands behind `WITH`.

use super::aggregate::Aggregate;
use super::frames::{FrameIs, Frames, IpoMode, OwnFrames};
use super::moves::{NULL_FRAME, WORLD};
use super::{Module, Value};
use crate::geom::Pose;
use crate::programs::reason::LeftReason;
use crate::programs::scan::Reader;

impl Module<'_> {
    pub(super) fn frame(&self, value: &Value) -> FrameIs {
        if let Value::Name(name) = value
            && [NULL_FRAME, WORLD].contains(&name.as_str())
        {
            return FrameIs::Known(Pose::identity());
        }
        match self.resolved(value) {
            Ok((aggregate, _)) => match aggregate.frame() {
                Some(frame) => FrameIs::Known(frame),
                None => FrameIs::untold("not all of X, Y, Z, A, B, C are given"),
            },
            Err(why) if why.reason == LeftReason::Computed => FrameIs::untold("it is computed, not written in numbers"),
            Err(why) => FrameIs::untold(why.words),
        }
    }

    /// `TOOL_DATA[n]` or `BASE_DATA[n]`; number 0 is the flange or the world.
    fn numbered(&self, table: &str, number: i64) -> FrameIs {
        match number {
            0 => FrameIs::Known(Pose::identity()),
            n if table == "BASE_DATA" && self.is_on_kinematic(n) => {
                FrameIs::moving(format!("MACHINE_FRAME_DAT[{n}] puts it on an external kinematic"))
            }
            n => self.frame(&Value::Name(format!("{table}[{n}]"))),
        }
    }

    /// True for a base that an external kinematic carries; kinematic 1 is the robot.
    fn is_on_kinematic(&self, number: i64) -> bool {
        match self.values.get(&format!("MACHINE_FRAME_DAT[{number}]")) {
            Some(Value::Aggregate(frame)) => frame.whole("MACH_DEF_INDEX").is_some_and(|index| index > 1),
            _ => false,
        }
    }

    /// Tool and base of a set of motion data, as `BAS` sets them.
    pub(super) fn data_frames(&self, data: &Aggregate) -> Option<Frames> {
        let (tool, base) = (data.whole("TOOL_NO")?, data.whole("BASE_NO")?);
        Some(Frames {
            tool: self.numbered("TOOL_DATA", tool),
            base: self.numbered("BASE_DATA", base),
            ipo_mode: IpoMode::of_data(data),
        })
    }

    pub(super) fn use_data(&mut self, value: &Value) {
        let taken = self.resolved(value).ok().map(|(data, _)| data.clone());
        let data = self.frames_of(taken.as_ref());
        // Frames that are in force stay so until `BAS(#FRAMES)`, or what sets the rest of a motion, takes the data.
        let stays = |is: &FrameIs, new: &FrameIs| matches!(is, FrameIs::Known(_)) && is != new;
        let (tool, base) = (&self.now.0.tool.value, &self.now.0.base.value);
        let waits = stays(tool, &data.tool) || stays(base, &data.base);
        let untaken = |is: &FrameIs, new| is.either(new, "no BAS(#FRAMES) takes the motion data before it");
        let now = Frames { tool: untaken(tool, &data.tool), base: untaken(base, &data.base), ..data.clone() };
        self.now.0.set(if waits { now } else { data });
        self.motion_data = Some(taken);
    }

    /// Tool and base of motion data by what the frames of these numbers hold here.
    fn frames_of(&self, data: Option<&Aggregate>) -> Frames {
        let unknown = || FrameIs::untold("its motion data are in none of the files (give the .dat as well)");
        let frames = data.and_then(|data| self.data_frames(data));
        frames.unwrap_or_else(|| Frames { tool: unknown(), base: unknown(), ..Frames::default() })
    }

    /// `BAS(#FRAMES)` and what does the same takes the motion data.
    fn take_data(&mut self) {
        if let Some(data) = self.motion_data.clone() {
            let frames = self.frames_of(data.as_ref());
            self.now.0.set(frames);
        }
    }

    /// `BAS(#CP_PARAMS,..)` and `BAS(#CP_DAT)` take the data of a path.
    fn take_path_data(&mut self) {
        if let Some(keeps) = self.path_data {
            self.now.0.keeps_orientation.set(keeps);
        }
    }

    /// `WITH .., $TOOL = STOOL2(FP1), $BASE = SBASE(FP1.BASE_NO), ..` in the rest of a line.
    pub(super) fn with(&self, reader: &mut Reader<'_>) -> OwnFrames {
        let mut frames = OwnFrames::default();
        let mut within = false;
        while !reader.at_line_end() {
            let word = reader.name();
            within |= word.as_deref() == Some("WITH");
            let assigned = within && reader.ahead_is_mark(1, b'=');
            reader.at += 1;
            match word.as_deref().filter(|_| assigned) {
                Some("$TOOL") => {
                    reader.at += 1;
                    frames.tool = Some(self.stated_frame(reader, "TOOL_DATA", "TOOL_NO"));
                }
                Some("$BASE") => {
                    reader.at += 1;
                    frames.base = Some(self.stated_frame(reader, "BASE_DATA", "BASE_NO"));
                }
                Some("$IPO_MODE") => {
                    reader.at += 1;
                    frames.ipo_mode = Some(self.ipo_mode(reader));
                }
                Some("$ORI_TYPE") => {
                    reader.at += 1;
                    frames.keeps_orientation = Some(self.keeps_orientation(reader));
                }
                _ => {}
            }
        }
        frames
    }

    /// A frame as the inline forms state it: an aggregate, `TOOL_DATA[1]`, `STOOL2(FP1)`, `SBASE(FP1.BASE_NO)` or a number in brackets.
    fn stated_frame(&self, reader: &mut Reader<'_>, table: &str, number: &str) -> FrameIs {
        if let Some(coupled) = FrameIs::coupled(reader) {
            return coupled;
        }
        let called = reader.ahead_is_mark(1, b'(');
        if !called {
            let value = self.value(reader);
            return value.map_or_else(|e| FrameIs::untold(e.what), |v| self.frame(&v));
        }
        // Something may stand on it: `SBASE(2):{X 10}`.
        let close = reader.closing(reader.at + 1);
        let is_displaced = close.is_none_or(|close| reader.token_is_mark(close + 1, b':'));
        reader.at += 2;
        let stated = reader.take_number().filter(|_| close == Some(reader.at));
        if is_displaced {
            return self.frame(&Value::Expression);
        }
        if let Some((n, _)) = stated {
            return self.numbered(table, n as i64);
        }
        let data = reader.name().map(Value::Name).unwrap_or(Value::Expression);
        let found = self.resolved(&data).ok().and_then(|(data, _)| data.whole(number));
        match found {
            Some(n) => self.numbered(table, n),
            None => FrameIs::untold("its number is in none of the files (give the .dat as well)"),
        }
    }

    /// `#TCP`, `FP1.IPO_FRAME` and `SIPO_MODE(FP1.IPO_FRAME)`.
    pub(super) fn ipo_mode(&self, reader: &Reader<'_>) -> IpoMode {
        let named = |ahead| reader.name_of(reader.at + ahead);
        if reader.is_mark(b'#') {
            return IpoMode::named(named(1).as_deref());
        }
        let data = named(if reader.ahead_is_mark(1, b'(') { 2 } else { 0 }).map(Value::Name);
        let found = data.as_ref().and_then(|data| self.resolved(data).ok());
        found.map_or(IpoMode::Untold, |(data, _)| IpoMode::of_data(data))
    }

    /// `BAS(#TOOL, n)`, `BAS(#BASE, n)`, and `BAS(#INITMOV, 0)`, which sets tool 1, the world as base, and a tool that the robot holds.
    pub(super) fn bas(&mut self, reader: &mut Reader<'_>) {
        reader.at += 1;
        if !(reader.take_mark(b'(') && reader.take_mark(b'#')) {
            return;
        }
        let what = reader.name();
        reader.at += 1;
        reader.take_mark(b',');
        let number = reader.take_number().filter(|_| reader.is_mark(b')')).map(|(n, _)| n as i64);
        let frame = |table| match number {
            Some(n) => self.numbered(table, n),
            None => FrameIs::untold("its number is computed"),
        };
        match what.as_deref() {
            Some("TOOL") => self.now.0.tool.set(frame("TOOL_DATA")),
            Some("BASE") => self.now.0.base.set(frame("BASE_DATA")),
            Some("EX_BASE") => self.now.0.base.set(FrameIs::on_kinematic()),
            Some("CP_DAT") => self.take_path_data(),
            Some(taken) if taken == "FRAMES" || taken.ends_with("PARAMS") => {
                self.take_data();
                if taken.starts_with("CP") {
                    self.take_path_data();
                }
            }
            Some("INITMOV") => {
                let (tool, base) = (self.numbered("TOOL_DATA", 1), FrameIs::Known(Pose::identity()));
                self.now.0.set(Frames { tool, base, ipo_mode: IpoMode::Base });
                self.now.0.keeps_orientation.set(false);
            }
            _ => {}
        }
    }
}
