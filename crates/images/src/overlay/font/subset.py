"""Makes DejaVuSans-subset.ttf: Latin, Greek and mathematical signs of DejaVu Sans, without hinting.

    pip install fonttools && python3 subset.py /usr/share/fonts/truetype/dejavu/DejaVuSans.ttf

Tested with fonttools 4.68 and DejaVu Sans 2.37 (Debian: fonts-dejavu-core), whose licence is in LICENSE_DEJAVU.
"""
import pathlib
import sys

from fontTools import subset

RANGES = [
    (0x0020, 0x007E),  # Basic Latin
    (0x00A0, 0x017F),  # Latin-1, Latin Extended-A
    (0x02C6, 0x02DD),  # accents
    (0x0370, 0x03FF),  # Greek
    (0x2010, 0x2027),  # dashes, quotes, dots
    (0x2030, 0x203A),  # per mille, primes
    (0x2070, 0x209C),  # superscripts and subscripts
    (0x20AC, 0x20AC),  # euro
    (0x2100, 0x214F),  # letterlike signs
    (0x2190, 0x21D5),  # arrows
    (0x2200, 0x22FF),  # mathematical operators
    (0x25A0, 0x25CF),  # geometric shapes
]

options = subset.Options()
options.hinting = False
options.layout_features = []
options.legacy_kern = True
options.name_IDs = [0, 1, 2, 4, 5, 13, 14]
options.notdef_outline = True
options.drop_tables += ["FFTM", "GSUB", "GPOS", "GDEF", "MATH", "gasp"]
font = subset.load_font(sys.argv[1], options)
subsetter = subset.Subsetter(options)
subsetter.populate(unicodes=[c for low, high in RANGES for c in range(low, high + 1)])
subsetter.subset(font)
font["head"].modified = font["head"].created
font.recalcTimestamp = False
subset.save_font(font, str(pathlib.Path(__file__).with_name("DejaVuSans-subset.ttf")), options)
