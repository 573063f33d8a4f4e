"""Files that each step of `pedestal calibrate` writes: a parameter file and a page."""
from pedestal_common.graph import nodes
from pedestal_common.parameters import check_each
from pedestal_common.text_files import parameter_file


def write(options, printed, sections, page, iq=False) -> list[str]:
    """Write the files that the options `output` and `report` of a step name. Return a line for each of them.

    printed: lines that the step prints, for the head of the parameter file; sections: {node: {parameter: value}};
    page(): HTML text of the page; iq: True for the parameters of a receiver of I/Q samples. Raises ParameterError for
    a value out of its range.
    """
    said = []
    if options.output:
        for node, values in sections.items():
            check_each(nodes.row(node, iq=iq).parameters_type(), values)
        head = ''.join(f'# {line}'.rstrip() + '\n' for line in (f'made by: {" ".join(options.command.split())}',
                                                               *printed))
        options.output.write_text(head + parameter_file.text(sections), encoding='utf-8')
        said.append(f'written: {options.output}  (pedestal run SCENARIO --params-file {options.output})')
    if options.report:
        options.report.write_text(page(), encoding='utf-8')
        said.append(f'page: {options.report}')
    return said
