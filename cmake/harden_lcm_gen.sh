#!/bin/bash
# Make the C++ that lcm-gen 1.3.1 writes safe against hostile messages, in place:
#   harden_lcm_gen.sh GENERATED.hpp...
# Every element count is checked against the bytes that are left before anything is
# resized, and string lengths must be positive. An array of no elements is emptied: a message that is
# decoded into again and again would keep there what an earlier one had, even one that was refused.
# Fails if a file has a resize or such an array that it does not know.
set -eu
for f in "$@"; do
  sed -i -E '/^ *if\(this->[A-Za-z0-9_]+\) \{$/{
    N
    s/^( *)(if\((this->[A-Za-z0-9_]+)\) \{\n *(this->[A-Za-z0-9_]+(\[[a-z0-9]+\])*)\.resize\(\3\);)$/\1if(\3 == 0) \4.clear();\n\1\2/
  }' "$f"
  sed -i -E \
    -e 's/^( *)((this->[A-Za-z0-9_]+(\[[a-z0-9]+\])*)\.resize\((this->[A-Za-z0-9_]+|[0-9]+)\);)$/\1if (\5 < 0 || \5 > maxlen - pos) return -1;\n\1\2/' \
    -e 's/^( *)if\((__[A-Za-z0-9_]+_len_?_?) > maxlen - pos\) return -1;$/\1if (\2 < 1 || \2 > maxlen - pos) return -1;/' \
    "$f"
  n=$(grep -cE '\.resize\(' "$f" || true); g=$(grep -cE '^ *if \((this->[A-Za-z0-9_]+|[0-9]+) < 0 \|\| .* > maxlen - pos\) return -1;$' "$f" || true)
  [ "$n" = "$g" ] || { echo "harden_lcm_gen: $f: $n resizes, $g guards" >&2; exit 1; }
  a=$(grep -cE '^ *if\(this->[A-Za-z0-9_]+\) \{$' "$f" || true); c=$(grep -cE '\.clear\(\);$' "$f" || true)
  [ "$a" = "$c" ] || { echo "harden_lcm_gen: $f: $a arrays, $c emptied" >&2; exit 1; }
  ! grep -nE 'if\(__[A-Za-z0-9_]+ > maxlen' "$f" >&2 || { echo "harden_lcm_gen: $f: unguarded string" >&2; exit 1; }
done
