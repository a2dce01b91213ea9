//! Arguments of calls that move: values, and `get_inverse_kin` around a pose.

use super::{Argument, Script, Value, pose_of};
use crate::error::Result;
use crate::programs::program::{MeantPosture, Way};
use crate::programs::reason::{DeclaredPoint, LeftReason, Why};
use crate::programs::scan::TokenKind;

/// Parameters of `get_inverse_kin`, in their order.
const INVERSE: [&[u8]; 5] = [b"x", b"qnear", b"maxPositionError", b"maxOrientationError", b"tcp"];
/// Parameters of `movec`, in their order.
const ARC: [&[u8]; 6] = [b"pose_via", b"pose_to", b"a", b"v", b"r", b"mode"];
/// Its tool where none is named.
const ACTIVE: &[u8] = b"active_tcp";

impl Script<'_> {
    /// An argument, `name=` before it left out, `get_inverse_kin` around it looked into.
    pub(super) fn target_argument(&mut self, way: Way) -> Result<Argument> {
        self.skip_argument_name();
        let is_inverse = self.reader.word() == Some(b"get_inverse_kin") && self.reader.ahead_is_mark(1, b'(');
        if is_inverse {
            return self.inverse();
        }
        let taught = self.taught();
        let value = self.argument()?;
        let keeps = way != Way::Joints || matches!(value, Value::Pose(..));
        Ok(Argument { taught, posture: MeantPosture::ByWay(way), keeps, ..self.untaught(value) })
    }

    /// A value with the active tool, to which the robot goes in its posture.
    fn untaught(&self, value: Value) -> Argument {
        let (posture, tool) = (MeantPosture::ByWay(Way::Joints), self.active_tool());
        Argument { value, taught: None, posture, tool, points: Vec::new(), keeps: true, turns_as_told: true }
    }

    /// The pose in `get_inverse_kin(..)`, on whose name the reader stands; it ends behind the bracket.
    fn inverse(&mut self) -> Result<Argument> {
        let mut found = self.untaught(Value::Expression);
        let open = self.reader.at + 1;
        let Some(close) = self.reader.closing(open) else {
            self.reader.at = open;
            return Ok(found);
        };
        if let Some([Some(x), near, _, _, tool]) = self.places(&INVERSE, open, close) {
            self.reader.at = x;
            found.taught = self.taught();
            found.value = self.argument()?;
            if let Some(near) = near {
                self.reader.at = near;
                self.near(&mut found)?;
            }
            if let Some(tool) = tool {
                self.reader.at = tool;
                self.named_tool(&mut found)?;
            }
        }
        self.reader.at = close + 1;
        Ok(found)
    }

    /// Variables with targets in the argument at which the reader stands.
    pub(super) fn points_in_argument(&self, close: usize) -> Vec<DeclaredPoint> {
        let mut depth = 0;
        let mut points = Vec::new();
        for token in (0..).map_while(|k| self.reader.ahead(k)).take(close - self.reader.at) {
            match token.kind {
                TokenKind::Mark(b'(' | b'[') => depth += 1,
                TokenKind::Mark(b')' | b']') => depth -= 1,
                TokenKind::Mark(b',') if depth == 0 => break,
                _ => {}
            }
            let name = self.reader.text(token);
            if let Some(Value::Joints(_, line) | Value::Pose(_, line)) = self.variables.get(name) {
                let name = String::from_utf8_lossy(name).into_owned();
                points.push(DeclaredPoint { name, file: self.reader.index, line: *line });
            }
        }
        points
    }

    /// False where `movec` may leave the orientation as it is to its path, whatever its targets say (`mode`).
    pub(super) fn turns_as_told(&mut self, open: usize, close: usize) -> bool {
        let start = self.reader.at;
        let places = self.places(&ARC, open, close);
        let is_told = match places {
            Some([.., Some(mode)]) => {
                self.reader.at = mode;
                let is_zero = self.reader.take_number().is_some_and(|(mode, _)| mode == 0.0);
                self.reader.skip_line_ends();
                is_zero && (self.reader.at == close || self.reader.is_mark(b','))
            }
            Some(_) => true,
            None => false,
        };
        self.reader.at = start;
        is_told
    }

    /// Where the arguments of a call with these parameters begin; `None` for others than it has.
    fn places<const N: usize>(
        &mut self,
        parameters: &[&[u8]; N],
        open: usize,
        close: usize,
    ) -> Option<[Option<usize>; N]> {
        let mut found = [None; N];
        self.reader.at = open + 1;
        for k in 0.. {
            self.reader.skip_line_ends();
            if self.reader.at >= close {
                break;
            }
            let named = self.reader.ahead_is_mark(1, b'=').then(|| self.reader.word()).flatten();
            let place = named.map_or(Some(k), |name| parameters.iter().position(|parameter| *parameter == name))?;
            self.skip_argument_name();
            *found.get_mut(place)? = Some(self.reader.at);
            while self.reader.at < close && !self.reader.take_mark(b',') {
                let is_bracket = matches!(self.reader.peek().map(|t| t.kind), Some(TokenKind::Mark(b'(' | b'[')));
                let end = if is_bracket { self.reader.closing(self.reader.at)? } else { self.reader.at };
                self.reader.at = end + 1;
            }
        }
        Some(found)
    }

    /// Joints near which a pose is reached: `qnear`.
    fn near(&mut self, found: &mut Argument) -> Result<()> {
        let own = self.reader.word() == Some(b"get_actual_joint_positions");
        match self.argument()? {
            Value::Joints(fields, _) if fields.len() == self.setting.axes.len() => {
                found.posture = MeantPosture::Near(self.readings(&fields));
            }
            // The joints beside the pose are better than a `qnear` that the text does not tell.
            _ if own || found.taught.is_some() => {}
            _ => (found.value, found.keeps) = (Value::Expression, false),
        }
        Ok(())
    }

    /// The tool for which joints are computed: `tcp`, a pose or the active one.
    fn named_tool(&mut self, found: &mut Argument) -> Result<()> {
        let text = self.reader.peek().map(|token| self.reader.text(token));
        if text.is_some_and(|text| text.get(1..text.len().saturating_sub(1)) == Some(ACTIVE)) {
            return Ok(());
        }
        found.tool = match self.argument()? {
            Value::Pose(fields, _) => Ok(pose_of(&fields)),
            _ => self.setting.tool.ok_or_else(|| {
                let words = "the tcp of its get_inverse_kin is not written in numbers; give --tool";
                Why::new(LeftReason::ToolUnknown, words)
            }),
        };
        Ok(())
    }

    /// Joints of `name_q` where the reader stands on `name_p`.
    fn taught(&self) -> Option<Vec<f64>> {
        let stem = self.reader.word()?.strip_suffix(b"_p")?;
        let name = [stem, b"_q"].concat();
        match self.variables.get(&name).filter(|_| !self.computed.contains(&name))? {
            Value::Joints(fields, _) if fields.len() == self.setting.axes.len() => Some(self.readings(fields)),
            _ => None,
        }
    }

    fn skip_argument_name(&mut self) {
        if self.reader.word().is_some() && self.reader.ahead(1).is_some_and(|t| t.kind == TokenKind::Mark(b'=')) {
            self.reader.at += 2;
        }
    }

    /// A value that ends with the argument; anything longer is an expression.
    pub(super) fn argument(&mut self) -> Result<Value> {
        let value = match self.reader.word() {
            Some(word) if word != b"p" || !self.reader.ahead(1).is_some_and(|t| t.kind == TokenKind::Mark(b'[')) => {
                self.reader.at += 1;
                let known = self.variables.get(word).filter(|_| !self.computed.contains(word));
                known.cloned().unwrap_or(Value::Expression)
            }
            _ => self.value()?,
        };
        let ends = self.reader.is_mark(b',') || self.reader.is_mark(b')');
        Ok(if ends { value } else { Value::Expression })
    }
}
