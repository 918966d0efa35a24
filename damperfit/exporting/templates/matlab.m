{{ comments("%", about) }}
setting_label = { {%- for table in tables %}'{{ table.setting | string | one_line | replace("'", "''") }}'{{ "" if loop.last else ", " }}{% endfor -%} };
{% for name, matrix in variables.items() %}
{{ name }} = [{% for row in matrix %}{% for cell in row %}{{ "%.9g" | format(cell) }}{{ "" if loop.last else " " }}{% endfor %}{{ "" if loop.last else ";\n  " }}{% endfor %}];
{% endfor %}
