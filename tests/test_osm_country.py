"""Which side traffic keeps to, and other rules of countries, by where an extract lies and what it shows."""

from pathlib import Path
from typing import Any

import pytest
from osm_drawings import DRAWINGS, HELSINKI, LONDON, SYDNEY, Drawing, cross

from dojo_maps.conversion import ConvertOptions, convert
from dojo_maps.errors import UsageError
from dojo_maps.sources.osm import read_osm
from dojo_maps.sources.osm.read.boundaries import country_at
from dojo_maps.sources.osm.read.country import Country, EqualRoads, read_country
from dojo_maps.sources.osm.read.data import OsmData, OsmNode

LEFT = """
GB London -0.13 51.51, GB Newry -6.34 54.18, GB Folkestone 1.17 51.08, IE Dublin -6.26 53.35,
IE Dundalk -6.40 54.00, IM Douglas -4.48 54.15, JE St Helier -2.10 49.19, GG St Peter Port -2.54 49.46,
MT Valletta 14.51 35.90, CY Limassol 33.04 34.68, CY Kyrenia 33.32 35.34, CY Famagusta 33.94 35.12,
IN Delhi 77.21 28.61, IN Srinagar 74.80 34.08, IN Moreh 94.305 24.245, IN Raxaul 84.85 26.98,
PK Karachi 67.01 24.86, PK Taftan 61.59 28.98, PK Gilgit 74.31 35.92, PK Chaman 66.45 30.92,
BD Dhaka 90.41 23.81, BD Teknaf 92.30 20.86, NP Kathmandu 85.32 27.71, BT Thimphu 89.64 27.47,
LK Colombo 79.86 6.93, MV Male 73.51 4.17, TH Bangkok 100.50 13.75, TH Nong Khai 102.741 17.878,
TH Mae Sai 99.881 20.428, TH Aranyaprathet 102.506 13.692, TH Ranong 98.63 9.96, MY Kuala Lumpur 101.69 3.14,
MY Tawau 117.89 4.25, SG Singapore 103.82 1.35, BN Bandar Seri Begawan 114.94 4.89, ID Jakarta 106.85 -6.21,
ID Jayapura 140.70 -2.53, ID Kupang 123.61 -10.18, TL Dili 125.57 -8.56, TL Pante Macassar 124.37 -9.20,
HK Mong Kok 114.17 22.32, HK Lok Ma Chau 114.066 22.512, MO Macau 113.543 22.193, JP Tokyo 139.69 35.69,
JP Tsushima 129.29 34.20, JP Naha 127.68 26.21, AU Sydney 151.21 -33.87, AU Darwin 130.84 -12.46,
AU Boigu 142.22 -9.23, NZ Auckland 174.76 -36.85, PG Port Moresby 147.19 -9.44, PG Vanimo 141.30 -2.68,
SB Honiara 159.96 -9.43, FJ Suva 178.44 -18.14, WS Apia -171.77 -13.83, TO Nukualofa -175.20 -21.14,
KI Tarawa 173.00 1.33, NR Nauru 166.93 -0.53, TV Funafuti 179.20 -8.52, CK Avarua -159.78 -21.21,
ZA Cape Town 18.42 -33.92, ZA Musina 30.04 -22.34, NA Windhoek 17.08 -22.56, NA Oshikango 15.89 -17.40,
NA Katima Mulilo 24.27 -17.50, BW Gaborone 25.91 -24.65, ZW Harare 31.05 -17.83, ZM Livingstone 25.85 -17.85,
ZM Chililabombwe 27.83 -12.37, MZ Maputo 32.57 -25.97, MZ Tete 33.59 -16.16, MW Lilongwe 33.78 -13.97,
LS Maseru 27.48 -29.31, SZ Mbabane 31.14 -26.31, TZ Dar es Salaam 39.28 -6.82, TZ Kigoma 29.63 -4.88,
TZ Zanzibar 39.20 -6.16, KE Nairobi 36.82 -1.29, KE Mandera 41.86 3.94, UG Kampala 32.58 0.35,
UG Arua 30.91 3.02, MU Port Louis 57.50 -20.16, SC Victoria 55.45 -4.62, SH Jamestown -5.72 -15.92,
FK Stanley -57.85 -51.69, GY Georgetown -58.16 6.80, GY Lethem -59.79 3.38, SR Paramaribo -55.17 5.85,
SR Albina -54.05 5.50, TT Port of Spain -61.52 10.66, BB Bridgetown -59.62 13.10, GD St Georges -61.75 12.05,
VC Kingstown -61.23 13.16, LC Castries -60.99 14.01, DM Roseau -61.39 15.30, MS Brades -62.20 16.79,
AG St Johns -61.85 17.12, KN Basseterre -62.72 17.30, AI The Valley -63.05 18.22, VG Road Town -64.62 18.43,
VI Charlotte Amalie -64.93 18.34, JM Kingston -76.79 18.00, KY George Town -81.38 19.29,
TC Grand Turk -71.14 21.46, BS Nassau -77.35 25.06, BM Hamilton -64.78 32.29
"""
RIGHT = """
FR Calais 1.86 50.95, FR Cherbourg -1.62 49.64, GI Gibraltar -5.353 36.140, ES La Linea -5.347 36.160,
FI Helsinki 24.94 60.17, DE Berlin 13.40 52.52, SE Stockholm 18.07 59.33, IS Reykjavik -21.94 64.15,
IT Catania 15.09 37.50, TN Sfax 10.76 34.74, TR Mersin 34.64 36.81, LB Beirut 35.50 33.89,
CN Luohu 114.118 22.540, CN Zhuhai 113.553 22.272, TW Taipei 121.56 25.03, KR Busan 129.07 35.18,
LA Vientiane 102.613 17.964, LA Savannakhet 104.75 16.56, MM Tachileik 99.883 20.447, MM Tamu 94.315 24.220,
MM Maungdaw 92.37 20.82, MM Kawthaung 98.55 9.98, KH Poipet 102.563 13.657, VN Hanoi 105.83 21.03,
PH Zamboanga 122.08 6.91, AF Spin Boldak 66.40 31.01, AF Jalalabad 70.45 34.43, IR Mirjaveh 61.45 29.03,
IR Chabahar 60.64 25.29, CN Tashkurgan 75.23 37.77, CN Shigatse 88.88 29.27, TJ Khorog 71.55 37.49,
ET Moyale 39.050 3.560, SO Bula Hawo 41.88 3.93, SO Kismayo 42.54 -0.36, SS Juba 31.58 4.85,
RW Kigali 30.06 -1.94, RW Gatuna 30.02 -1.43, BI Kobero 30.42 -2.80, BI Bujumbura 29.36 -3.38,
CD Goma 29.22 -1.68, CD Aru 30.84 2.87, CD Kasumbalesa 27.79 -12.25, CD Uvira 29.14 -3.40,
AO Santa Clara 15.88 -17.37, AO Luanda 13.23 -8.84, MG Antananarivo 47.53 -18.88, KM Moroni 43.25 -11.70,
YT Mamoudzou 45.23 -12.78, RE Saint-Denis 55.45 -20.88, NG Lagos 3.40 6.45, GH Accra -0.19 5.60,
BR Bonfim -59.82 3.37, BR Belem -48.50 -1.46, VE Tumeremo -61.50 7.30, GF Saint-Laurent -54.03 5.50,
MF Marigot -63.08 18.07, GP Pointe-a-Pitre -61.53 16.24, MQ Fort-de-France -61.07 14.60,
PR San Juan -66.11 18.47, HT Cap-Haitien -72.20 19.76, CU Havana -82.38 23.13, BZ Belize City -88.19 17.50,
NC Noumea 166.45 -22.27, VU Port Vila 168.32 -17.73, AS Pago Pago -170.70 -14.28, GU Hagatna 144.75 13.47,
US Honolulu -157.86 21.31, US Miami -80.19 25.76, CA Vancouver -123.12 49.28, MX Tijuana -117.04 32.51,
IO Diego Garcia 72.41 -7.31, EG Cairo 31.24 30.04, AR Ushuaia -68.30 -54.80
"""


def places(listed: str, *, left: bool) -> list[Any]:
    rows = [row.split() for row in listed.replace("\n", " ").split(",")]
    return [
        pytest.param(row[0], float(row[-2]), float(row[-1]), left, id=" ".join(row[1:-2])) for row in rows
    ]


@pytest.mark.parametrize(("code", "lon", "lat", "left"), places(LEFT, left=True) + places(RIGHT, left=False))
def test_country_and_side_of_cities_and_border_towns(
    code: str, lon: float, lat: float, *, left: bool
) -> None:
    assert country_at(lon, lat) == code
    found = read_country(OsmData(nodes={1: OsmNode(lon=lon, lat=lat)}, ways={}, relations={}))
    assert (found.code, found.left_hand) == (code, left)


def country_of(drawing: Drawing, folder: Path, drive: str | None = None) -> Country:
    return read_country(read_osm(drawing.write(folder / "a.osm")), drive)


def drawn(name: str, centre: tuple[float, float], *, backwards: int = 0) -> Drawing:
    drawing = DRAWINGS[name]()
    drawing.centre = centre
    for way in drawing.ways[:backwards]:
        way[0].reverse()
    return drawing


def test_high_seas_have_no_country_and_keep_right(tmp_path: Path) -> None:
    found = country_of(drawn("cross", (-30.0, 0.0)), tmp_path)
    assert (found.code, found.left_hand) == ("", False)
    assert "no country" in found.told_by


def test_tag_outweighs_the_country(tmp_path: Path) -> None:
    tagged = cross()
    tagged.ways[0][1]["driving_side"] = "left"
    found = country_of(tagged, tmp_path)
    assert found.left_hand
    assert "FI" in found.doubted


def test_roundabouts_outweigh_the_country_if_all_turn_so(tmp_path: Path) -> None:
    assert country_of(drawn("roundabout", HELSINKI, backwards=1), tmp_path).left_hand
    assert not country_of(drawn("roundabout", LONDON), tmp_path).left_hand
    two = drawn("roundabout", HELSINKI, backwards=1)
    square = [(400.0, 0.0), (420.0, 0.0), (420.0, 20.0), (400.0, 20.0)]
    two.way(*square, square[0], highway="tertiary", junction="roundabout")
    found = country_of(two, tmp_path)
    assert not found.left_hand
    assert found.doubted == "1 of 2 roundabouts turn the other way"
    backwards = drawn("roundabout", HELSINKI)
    backwards.ways[0][0].reverse()
    backwards.ways[0][1]["oneway"] = "-1"
    assert not country_of(backwards, tmp_path).left_hand


def test_side_that_is_asked_for_is_kept_and_told(tmp_path: Path) -> None:
    path = cross().write(tmp_path / "a.osm")
    bundle, report = convert(str(path), tmp_path / "a.dojo", ConvertOptions(drive="left", surroundings=False))
    assert bundle.road_map.left_hand
    assert (report["osm"]["country"], report["osm"]["driving_side"]) == ("FI", "left")
    (told,) = [issue for issue in report["issues"] if issue["check"] == "osm.driving_side"]
    assert told["severity"] == "warning"
    assert "asked for" in told["message"]


def test_side_is_a_note_where_nothing_speaks_against_it(tmp_path: Path) -> None:
    path = cross(SYDNEY).write(tmp_path / "a.osm")
    bundle, report = convert(str(path), tmp_path / "a.dojo", ConvertOptions(surroundings=False))
    assert bundle.road_map.left_hand
    (told,) = [issue for issue in report["issues"] if issue["check"] == "osm.driving_side"]
    assert told["severity"] == "note"
    assert told["message"] == "traffic keeps left, for the area lies in AU"


def test_side_is_asked_of_openstreetmap_data_only(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--drive"):
        convert("cologne1", tmp_path / "a.dojo", ConvertOptions(drive="left"))


@pytest.mark.parametrize(
    ("code", "rule"),
    [
        ("DE", EqualRoads.RIGHT_FIRST), ("GB", EqualRoads.ROAD_THAT_ENDS), ("", EqualRoads.ROAD_THAT_ENDS),
        ("US", EqualRoads.RIGHT_AT_CROSSROADS), ("AU", EqualRoads.RIGHT_AT_CROSSROADS),
        ("JP", EqualRoads.LEFT_FIRST),
    ],
)  # fmt: skip
def test_who_goes_first_on_equal_roads(code: str, rule: EqualRoads) -> None:
    assert Country(code=code, left_hand=False, told_by="a test").equal_roads is rule
