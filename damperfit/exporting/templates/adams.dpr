{% macro ruler(name) %}${{ "-" * (79 - name | length) }}{{ name }}{% endmacro %}
{{ ruler("MDI_HEADER") }}
[MDI_HEADER]
 FILE_TYPE     =  'dpr'
 FILE_VERSION  =  4.0
 FILE_FORMAT   =  'ASCII'
{{ comments("$", header(
    "velocity in mm/s and force in N are positive in rebound, as the damper grows longer",
    "give it as gas preload, or add it to the spring") + intervals(1e3)) }}
{{ ruler("UNITS") }}
[UNITS]
 LENGTH  =  'mm'
 ANGLE  =  'degrees'
 FORCE  =  'newton'
 MASS  =  'kg'
 TIME  =  'second'
{{ ruler("CURVE") }}
[CURVE]
{   vel       force}
{% for range, rows in ranges %}
{% if not loop.first %}
$ {{ range | upper }} from here on
{% endif %}
{% for v, f in rows %}
{{ "%12.4f %14.3f" | format(1e3 * v, f) }}
{% endfor %}
{% endfor %}
