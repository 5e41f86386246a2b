//! The numbers behind accessors, within the bounds of their buffers.

use gltf::{Accessor, accessor::DataType};

use super::File;

impl File<'_> {
    /// An accessor's items as N floats each; whole numbers are shares of the largest of their type.
    pub fn rows<const N: usize>(&self, accessor: &Accessor) -> Result<Vec<[f32; N]>, String> {
        let kind = accessor.data_type();
        let component: fn(&[u8]) -> f32 = match kind {
            DataType::U8 => |bytes| f32::from(bytes[0]) / f32::from(u8::MAX),
            DataType::U16 => |bytes| f32::from(u16(bytes)) / f32::from(u16::MAX),
            DataType::F32 => |bytes| f32::from_bits(u32(bytes)),
            other => return Err(format!("accessor {} has type {other:?}", accessor.index())),
        };
        if accessor.dimensions().multiplicity() < N {
            let dimensions = accessor.dimensions();
            return Err(format!("accessor {} has {dimensions:?} for {N}", accessor.index()));
        }
        let items = self.items(accessor)?.into_iter();
        Ok(items.map(|item| std::array::from_fn(|i| component(&item[i * kind.size()..]))).collect())
    }

    /// An accessor's whole numbers.
    pub fn indices(&self, accessor: &Accessor) -> Result<Vec<u32>, String> {
        let index: fn(&[u8]) -> u32 = match accessor.data_type() {
            DataType::U8 => |bytes| bytes[0].into(),
            DataType::U16 => |bytes| u16(bytes).into(),
            DataType::U32 => u32,
            other => return Err(format!("indices have type {other:?}")),
        };
        Ok(self.items(accessor)?.into_iter().map(index).collect())
    }

    /// The bytes of each item.
    fn items(&self, accessor: &Accessor) -> Result<Vec<&[u8]>, String> {
        let refuse = |reason: &str| format!("accessor {} {reason}", accessor.index());
        if accessor.sparse().is_some() {
            return Err(refuse("is sparse, for which there is no reader"));
        }
        let view = accessor.view().ok_or_else(|| refuse("has no buffer"))?;
        let size = accessor.size();
        let stride = view.stride().unwrap_or(size).max(size);
        let bytes = self.buffers.get(view.buffer().index());
        let bytes = bytes.and_then(|bytes| slice(bytes, view.offset(), view.length()));
        let last = accessor.count().checked_sub(1).and_then(|last| last.checked_mul(stride));
        let length = last.and_then(|last| last.checked_add(size));
        let bytes = bytes.zip(length).and_then(|(b, length)| slice(b, accessor.offset(), length));
        let bytes = bytes.ok_or_else(|| refuse("is empty, or leaves its buffer"))?;
        Ok(bytes.chunks(stride).map(|chunk| &chunk[..size]).collect())
    }
}

/// A part of a buffer, if the buffer has it.
pub fn slice(bytes: &[u8], offset: usize, length: usize) -> Option<&[u8]> {
    bytes.get(offset..)?.get(..length)
}

fn u16(bytes: &[u8]) -> u16 {
    u16::from_le_bytes([bytes[0], bytes[1]])
}

fn u32(bytes: &[u8]) -> u32 {
    u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
}
