"""The names of numba on which the compiler of the laws stands (law.py), one test for each.

Numba promises none of them. After an upgrade of numba these tests tell which name has changed.
"""
import inspect
import operator

import numba
import pytest
from numba.core import compiler, types
from numba.core.environment import Environment
from numba.core.registry import cpu_target

from pedestal_common.compiled import compiled

pytestmark = pytest.mark.every_case

SIGNATURES = (
    ('base.BaseContext.insert_user_function', '(self, func, fndesc, libs=())'),
    ('base.BaseContext.push_code_library', '(self, lib)'),
    ('base.BaseContext.subtarget', '(self, **kws)'),
    ('codegen.Codegen.create_library', '(self, name, **kwargs)'),
    ('codegen.CodeLibrary.enable_object_caching', '(self)'),
    ('codegen.JITCodeLibrary.__init__', '(self, codegen, name)'),
    ('codegen.JITCodeLibrary._finalize_dynamic_globals', '(self)'),
    ('codegen.JITCodeLibrary._get_module_for_linking', '(self)'),
    ('codegen.JITCodeLibrary.add_linking_library', '(self, library)'),
    ('codegen.JITCodeLibrary.add_llvm_module', '(self, ll_module)'),
    ('codegen.JITCodeLibrary.finalize', '(self)'),
    ('codegen.JITCodeLibrary.get_pointer_to_function', '(self, name)'),
    ('codegen.JITCPUCodegen.set_env', '(self, env_name, env)'),
    ('compiler.Compiler._compile_bytecode', '(self)'),
    ('compiler.CompileResult._find_referenced_environments', '(self)'),
    ('compiler.CompileResult._rebuild', '(target_context, libdata, fndesc, env, signature, objectmode, lifted, '
                                        'typeann, reload_init, referenced_envs)'),
    ('compiler.CompileResult._reduce', '(self)'),
    ('compiler.compile_result', '(**entries)'),
    ('cpu.CPUContext.codegen', '(self)'),
    ('cpu.CPUContext.create_cpython_wrapper', '(self, library, fndesc, env, call_helper, release_gil=False)'),
    ('cpu.CPUContext.get_executable', '(self, library, fndesc, env)'),
    ('dispatcher.Dispatcher.add_overload', '(self, cres)'),
    ('dispatcher.Dispatcher.compile', '(self, sig)'),
    ('dispatcher.Dispatcher.get_call_template', '(self, args, kws)'),
    ('dispatcher.Dispatcher.get_overload', '(self, sig)'),
    ('dispatcher.Dispatcher.typeof_pyval', '(self, val)'),
    ('environment.Environment.from_fndesc', '(fndesc)'),
    ('funcdesc.default_mangler', '(name, argtypes, *, abi_tags=(), uid=None)'),
    ('runtime.rtsys.initialize', '(ctx)'),
    ('typing.make_concrete_template', '(name, key, signatures)'),
)
"""Names in numba.core with their parameters."""


@pytest.mark.parametrize(('name', 'parameters'), SIGNATURES)
def test_a_function_of_numba_has_its_parameters(name, parameters):
    function = operator.attrgetter(name)(numba.core)
    assert str(inspect.signature(function)) == parameters, f'numba.core.{name} has other parameters in this release'


@compiled
def law(x):
    return x + 1.0


ATTRIBUTES = (
    ('CPUDispatcher', lambda: law, ('_cache_hits', '_cache_misses', '_compiler', '_numba_type_', '_type', 'locals',
                                    'overloads', 'targetctx', 'targetdescr', 'targetoptions', 'typingctx')),
    ('CPUDispatcher._compiler', lambda: law._compiler, ('fold_argument_types',)),
    ('CPUDispatcher.targetdescr.options', lambda: law.targetdescr.options, ('parse_as_flags',)),
    ('Context', lambda: law.typingctx, ('_globals', 'insert_global', 'resolve_function_type')),
    ('Flags', compiler.Flags, ('no_compile', 'no_cpython_wrapper', 'no_cfunc_wrapper')),
    ('JITCodeLibrary', lambda: cpu_target.target_context.codegen().create_library('library'),
     ('_final_module', '_finalized', '_linking_libraries', '_shared_module', 'has_dynamic_globals')),
    ('CompileResult.fndesc', lambda: law.translation((types.float64,)).fndesc,
     ('calltypes', 'env_name', 'llvm_func_name', 'qualname', 'typemap')),
    ('CompileResult', lambda: law.translation((types.float64,)),
     ('call_helper', 'entry_point', 'environment', 'library', 'signature')),
    ('CPUCodegen', lambda: cpu_target.target_context.codegen(), ('magic_tuple',)),
)
"""Classes of numba, objects of them, and the attributes that are used."""


@pytest.mark.parametrize(('of', 'made', 'name'),
                         [(of, made, name) for of, made, names in ATTRIBUTES for name in names])
def test_an_object_of_numba_has_its_attribute(of, made, name):
    cpu_target.target_context.refresh()
    assert name in dir(made()), f'{of}.{name} does not exist in this release of numba'


def test_the_compiler_state_has_a_function_identity():
    """Its number and name become the symbol of the law, and its arguments are exchanged for some with a short text."""
    seen = []

    class Seen(compiler.Compiler):
        def _compile_bytecode(self):
            seen.append(self.state)
            identity = self.state.func_id
            assert identity.unique_name == f'{identity.func_qualname}${identity.unique_id}'
            return super()._compile_bytecode()

    assert numba.njit(lambda x: x + 1, pipeline_class=Seen)(1) == 2
    assert seen[0].args == (types.int64,) and hasattr(seen[0].targetctx, 'subtarget') and 'library' in seen[0]


def test_the_memo_of_environments_goes_by_their_name():
    """For this reason the wrapper of a law for Python has an environment of its own name."""
    made = law.translation((types.float64,))
    assert Environment.from_fndesc(made.fndesc) is made.environment


def test_the_runtime_library_exists_after_its_preparation():
    numba.core.runtime.rtsys.initialize(cpu_target.target_context)
    assert numba.core.runtime.rtsys.library is not None


def test_a_target_takes_its_own_symbols_and_reference_counts():
    context = cpu_target.target_context.subtarget(mangler=lambda name, argtypes, **tags: 'symbol', enable_nrt=True)
    assert context.mangler('law', ()) == 'symbol' and context.enable_nrt
