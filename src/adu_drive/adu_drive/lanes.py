"""Lanes: many drives at once, computed by vector instructions from the source of the laws of one drive.

The records of LANE_COUNT drives, of 8-byte numbers (words) each, become one flat array, a structure of arrays. Word r
of the record of lane i has the index r LANE_COUNT + i.

A law that uses the attributes of a record, such as `s.omega += c.h * a`, also compiles for one Lane. If the law is
inlined into a loop over the lanes, LLVM makes vector instructions of it. Their results equal those of the scalar code
to the last bit. A function for records and for Lanes loops by

    for i in range(count(s)):
        law(at(s, i), at(c, i))

Lanes exist in compiled code only, as pointers into the flat array, which must exist as long as they do.

The private functions below are the hooks by which numba types and compiles these operations: `_type_..` and `generic`
return the type of a result, the others generate its code.
"""
import hashlib
import operator
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, TypeAlias, TypeVar, cast

import numba
import numpy as np
from llvmlite.ir import IRBuilder, Value
from numba.core import types
from numba.core.base import BaseContext
from numba.core.datamodel.models import PointerModel
from numba.core.errors import NumbaTypeError
from numba.core.typing.context import BaseContext as TypingContext
from numba.core.typing.templates import (
    AbstractTemplate,
    AttributeTemplate,
    Signature,
    infer_getattr,
    infer_global,
    signature,
)
from numba.extending import (
    intrinsic,
    lower_builtin,
    lower_getattr_generic,
    lower_setattr_generic,
    register_model,
    type_callable,
)

from pedestal_common.law_key import template
from pedestal_common.quantities import AnyRecord, DType, Floats, Records

_R = TypeVar('_R')
Known: TypeAlias = tuple[tuple[str, int], ...]      # (attribute, number) of each
Values: TypeAlias = Sequence[Value]

LANE_COUNT = 32
"""Number of lanes of a flat array. With 16 lanes LLVM does not vectorise; 64 lanes exceed the first-level cache."""

WORD_BYTES = 8  # size of each number [bytes]
CACHE_LINE_BYTES = 64  # size of a line of the cache, and alignment of the flat array [bytes]


class _LanePointer(types.Type):
    """Pointer to the first word of a value in one lane."""
    dtype = types.float64
    what: types.Type    # of the value
    known: Known        # attributes with the same number in all lanes; compiled code takes the number as a constant

    def __init__(self, what: types.Type, known: Known) -> None:
        self.what, self.known = what, known
        digest = hashlib.sha256(f'{what} {known}'.encode()).hexdigest()[:16]
        super().__init__(f'{type(self).__name__}_{digest}')


class Lane(_LanePointer):
    """One lane of a record."""
    what: types.Record


class Lanes(_LanePointer):
    """All lanes of a record."""
    what: types.Record


class LaneArray(_LanePointer):
    """One lane of an array."""
    what: types.NestedArray


for place in (Lane, Lanes, LaneArray):
    register_model(place)(PointerModel)


def count(records: object) -> int:
    """Return the number of records, a constant of compiled code: 1 for a record, LANE_COUNT for Lanes."""
    return 1


def at(records: _R, i: int) -> _R:
    """Return record i of Lanes, or the record itself."""
    return records


template(count)
template(at)


@type_callable(count)
def _type_count(context: TypingContext) -> Callable[[types.Type], types.Type | None]:
    return lambda records: types.intp if isinstance(records, (types.Record, Lanes)) else None


@lower_builtin(count, types.Record)
@lower_builtin(count, Lanes)
def _count(context: BaseContext, builder: IRBuilder, signature: Signature, args: Values) -> Value:
    return context.get_constant(types.intp, LANE_COUNT if isinstance(signature.args[0], Lanes) else 1)


@type_callable(at)
def _type_at(context: TypingContext) -> Callable[[types.Type, types.Type], types.Type | None]:
    def typer(records: types.Type, i: types.Type) -> types.Type | None:
        if isinstance(records, Lanes):
            return Lane(records.what, records.known)
        return records if isinstance(records, types.Record) else None
    return typer


@lower_builtin(at, types.Record, types.Integer)
@lower_builtin(at, Lanes, types.Integer)
def _at(context: BaseContext, builder: IRBuilder, signature: Signature, args: Values) -> Value:
    records, i = signature.args
    if isinstance(records, types.Record):
        return args[0]
    return builder.gep(args[0], [context.cast(builder, args[1], i, types.intp)], inbounds=True)


def _member(place: Lane | Lanes, attribute: str) -> types.Type:
    field = place.what.typeof(attribute)
    if isinstance(field, types.Record):
        return type(place)(field, place.known)
    number: Any = field.dtype if isinstance(field, types.NestedArray) else field   # numba declares no bitwidth
    if not isinstance(number, types.Record) and number.bitwidth != 8 * WORD_BYTES:
        raise NumbaTypeError(f'{attribute} is {number}: must have {WORD_BYTES} bytes on lanes')
    return LaneArray(field, place.known) if isinstance(field, types.NestedArray) else field


def _offset_pointer(context: BaseContext, builder: IRBuilder, pointer: Value, words: int | Value) -> Value:
    if isinstance(words, int):
        return builder.gep(pointer, [context.get_constant(types.intp, words * LANE_COUNT)], inbounds=True)
    rows = builder.mul(words, context.get_constant(types.intp, LANE_COUNT))
    return builder.gep(pointer, [rows], inbounds=True)


def _word(context: BaseContext, builder: IRBuilder, pointer: Value, field: types.Type) -> Value:
    return builder.bitcast(pointer, context.get_data_type(field).as_pointer())


class _Attributes(AttributeTemplate):
    def generic_resolve(self, place: Lane | Lanes, attribute: str) -> types.Type | None:
        """Return the type of an attribute; None for a number of all Lanes at once, which has no type."""
        if attribute in place.what.fields:
            member = _member(place, attribute)
            return member if isinstance(place, Lane) or isinstance(member, Lanes) else None
        return None


for place in (Lane, Lanes):
    infer_getattr(type(f'{place.__name__}Attributes', (_Attributes,), {'key': place}))


@lower_getattr_generic(Lane)
@lower_getattr_generic(Lanes)
def _get(context: BaseContext, builder: IRBuilder, place: Lane | Lanes, value: Value, attribute: str) -> Value:
    member, known = _member(place, attribute), dict(place.known)
    if attribute in known and not isinstance(member, _LanePointer):
        return context.get_constant(member, known[attribute])
    pointer = _offset_pointer(context, builder, value, place.what.offset(attribute) // WORD_BYTES)
    return pointer if isinstance(member, _LanePointer) else builder.load(_word(context, builder, pointer, member))


@lower_setattr_generic(Lane)
def _set(context: BaseContext, builder: IRBuilder, signature: Signature, args: Values, attribute: str) -> None:
    place, given = signature.args
    member = _member(place, attribute)
    pointer = _offset_pointer(context, builder, args[0], place.what.offset(attribute) // WORD_BYTES)
    builder.store(context.cast(builder, args[1], given, member), _word(context, builder, pointer, member))


def _indices(index: types.Type) -> tuple[types.Type, ...]:
    members: Any = index    # numba declares no iteration
    return tuple(members) if isinstance(index, types.BaseTuple) else (index,)


def _item(array: LaneArray, index: types.Type) -> tuple[types.Type, types.Type] | None:
    """Return (type of an item of a LaneArray, type of its index); None for an invalid index."""
    nested, indices = array.what, _indices(index)
    if len(indices) > nested.ndim or not all(isinstance(i, types.Integer) for i in indices):
        return None
    left = nested.shape[len(indices):]
    item = LaneArray(types.NestedArray(nested.dtype, left), array.known) if left else (
        Lane(nested.dtype, array.known) if isinstance(nested.dtype, types.Record) else nested.dtype)
    kind = types.UniTuple(types.intp, len(indices)) if isinstance(index, types.BaseTuple) else types.intp
    return item, kind


@infer_global(operator.getitem)
class _GetItem(AbstractTemplate):
    def generic(self, args: tuple[types.Type, ...], keywords: object) -> Signature | None:
        array, index = args
        found = _item(array, index) if isinstance(array, LaneArray) else None
        return signature(found[0], array, found[1]) if found else None


@infer_global(operator.setitem)
class _SetItem(AbstractTemplate):
    def generic(self, args: tuple[types.Type, ...], keywords: object) -> Signature | None:
        array, index, _ = args
        found = _item(array, index) if isinstance(array, LaneArray) else None
        if found and not isinstance(found[0], _LanePointer):
            return signature(types.none, array, found[1], found[0])
        return None


def _item_pointer(context: BaseContext, builder: IRBuilder, array: LaneArray, index_type: types.Type, pointer: Value,
                  index: Value) -> Value:
    many = isinstance(index_type, types.BaseTuple)
    indices = tuple(builder.extract_value(index, i) for i in range(len(_indices(index_type)))) if many else (index,)
    shape, words = array.what.shape, context.get_constant(types.intp, 0)
    size = array.what.dtype.size // WORD_BYTES if isinstance(array.what.dtype, types.Record) else 1
    for i, n in zip((*indices, *(None,) * (len(shape) - len(indices))), shape):
        words = builder.mul(words, context.get_constant(types.intp, n))
        words = words if i is None else builder.add(words, i)
    return _offset_pointer(context, builder, pointer, builder.mul(words, context.get_constant(types.intp, size)))


@lower_builtin(operator.getitem, LaneArray, types.Any)
def _get_item(context: BaseContext, builder: IRBuilder, signature: Signature, args: Values) -> Value:
    array, index = signature.args
    pointer = _item_pointer(context, builder, array, index, *args)
    item = signature.return_type
    return pointer if isinstance(item, _LanePointer) else builder.load(_word(context, builder, pointer, item))


@lower_builtin(operator.setitem, LaneArray, types.Any, types.Any)
def _set_item(context: BaseContext, builder: IRBuilder, signature: Signature, args: Values) -> Value:
    array, index, item = signature.args
    pointer = _item_pointer(context, builder, array, index, *args[:2])
    builder.store(args[2], _word(context, builder, pointer, item))
    return context.get_dummy_value()


def view(dtype: DType, known: Mapping[str, int] = MappingProxyType({})) -> Callable[[Floats], AnyRecord]:
    """Return a function for compiled code that gives the Lanes of records of this type in a flat array of `to_lanes`.

    known: {attribute: number} of flags, at any depth of the record, with this number in every lane. Code that these
    flags switch off is not compiled.
    """
    lanes = Lanes(numba.from_dtype(dtype), tuple(sorted(dict(known).items())))

    @intrinsic
    def of(typing_context: TypingContext, flat: types.Type) -> tuple[Signature, Callable[..., Value]]:
        def pointer(context: BaseContext, builder: IRBuilder, signature: Signature, args: Values) -> Value:
            return context.make_array(signature.args[0])(context, builder, value=args[0]).data
        return lanes(flat), pointer
    return cast(Callable[[Floats], AnyRecord], of)


def to_lanes(records: Records) -> Floats:
    """Return records (n,), n <= LANE_COUNT, as the flat array (words LANE_COUNT,) of their Lanes. The last record
    fills the other lanes."""
    words = _words(records)
    lane = np.minimum(np.arange(LANE_COUNT), len(records) - 1)
    flat = _aligned(words.shape[1] * LANE_COUNT)
    flat.reshape(-1, LANE_COUNT)[...] = words[lane].T
    return flat


def _aligned(count: int) -> Floats:
    """Return an array (count,) that begins at a cache line. In an array of numpy each vector of 8 lanes may lie in two
    lines, and the drives then take up to an eighth more time."""
    store = np.empty(count + CACHE_LINE_BYTES // WORD_BYTES)
    skipped = -store.ctypes.data % CACHE_LINE_BYTES // WORD_BYTES
    return store[skipped:skipped + count]


def from_lanes(flat: Floats, records: Records) -> None:
    """Copy the first lanes of a flat array into records (n,)."""
    _words(records)[...] = flat.reshape(-1, LANE_COUNT).T[:len(records)]


def _words(records: Records) -> Floats:
    return records.view(np.float64).reshape(len(records), -1)
