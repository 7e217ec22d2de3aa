# Writes the text of IN as a C++ raw string literal into OUT.
file(READ ${IN} text)
file(WRITE ${OUT} "R\"veneer_text(${text})veneer_text\"\n")
