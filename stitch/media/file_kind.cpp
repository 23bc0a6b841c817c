#include "stitch/media/file_kind.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <string>
#include <utility>

#include "stitch/media/tiff_directory.h"

namespace nodal::media {
namespace {

using namespace std::string_view_literals;

constexpr FileKind kEmpty{"an empty file", "empty files", "copy it from the camera again"};
constexpr FileKind kRaw{"a camera's raw file", "cameras' raw files",
                        "develop it to TIFF or JPEG (darktable-cli FILE FILE.tif)", true};
constexpr FileKind kHeif{"an HEIF file", "HEIF files", "convert it to JPEG or PNG (heif-convert FILE.heic FILE.jpg)",
                         true, true};
constexpr FileKind kAvif{"an AVIF file", "AVIF files", "convert it to JPEG or PNG (avifdec FILE.avif FILE.png)", true};
constexpr FileKind kJpegXl{"a JPEG XL file", "JPEG XL files", "convert it to JPEG or PNG (djxl FILE.jxl FILE.png)",
                           true};
constexpr FileKind kJpeg2000{"a JPEG 2000 file", "JPEG 2000 files",
                             "convert it to PNG (opj_decompress -i FILE.jp2 -o FILE.png)", true};
constexpr FileKind kWebP{"a WebP file", "WebP files", "convert it to PNG (dwebp FILE.webp -o FILE.png)", true, true};
constexpr FileKind kGif{"a GIF file", "GIF files", "convert it to PNG (convert FILE.gif FILE.png)", true};
constexpr FileKind kBmp{"a BMP file", "BMP files", "convert it to PNG (convert FILE.bmp FILE.png)", true};
constexpr FileKind kNetpbm{"a PNM file", "PNM files", "convert it to PNG (convert FILE FILE.png)", true};
constexpr FileKind kPhotoshop{"a Photoshop file", "Photoshop files", "export it as TIFF or PNG", true};
constexpr FileKind kExr{"an OpenEXR file", "OpenEXR files", "convert it to TIFF of 16 bits (convert FILE.exr FILE.tif)",
                        true};
constexpr FileKind kRadiance{"a Radiance HDR file", "Radiance HDR files",
                             "convert it to TIFF of 16 bits (convert FILE.hdr FILE.tif)", true};
constexpr FileKind kPdf{"a PDF", "PDFs", "give the pictures themselves"};
constexpr FileKind kArchive{"an archive", "archives", "unpack it first"};
constexpr FileKind kFilm{"a film", "films", "take its pictures out first (ffmpeg -i FILM picture-%04d.png)", true};
constexpr FileKind kSound{"a sound file", "sound files", ""};
constexpr FileKind kText{"a text file, not a picture (JPEG, PNG, TIFF, HEIF and WebP are read)", "text files", ""};
constexpr FileKind kUnknown{"a file of an unknown format (JPEG and PNG are read; by nodal also TIFF, HEIF and WebP)",
                            "files of unknown formats", ""};

struct Magic {
  std::size_t at;
  std::string_view bytes;
  const FileKind* kind;
};

constexpr std::array kMagics{
    Magic{0, "FUJIFILMCCD-RAW"sv, &kRaw},
    Magic{0, "IIRO"sv, &kRaw},  // Olympus
    Magic{0, "IIRS"sv, &kRaw},
    Magic{0, "MMOR"sv, &kRaw},
    Magic{0, "IIU\0"sv, &kRaw},   // Panasonic
    Magic{0, "FOVb"sv, &kRaw},    // Sigma
    Magic{0, "\0MRM"sv, &kRaw},   // Minolta
    Magic{8, "CR\2\0"sv, &kRaw},  // Canon, in a TIFF
    Magic{8, "WEBP"sv, &kWebP},
    Magic{8, "AVI "sv, &kFilm},
    Magic{8, "WAVE"sv, &kSound},
    Magic{0, "GIF8"sv, &kGif},
    Magic{0, "8BPS"sv, &kPhotoshop},
    Magic{0, "\x76\x2f\x31\x01"sv, &kExr},
    Magic{0, "#?RADIANCE"sv, &kRadiance},
    Magic{0, "#?RGBE"sv, &kRadiance},
    Magic{0,
          "\0\0\0\x0c"
          "jP  "sv,
          &kJpeg2000},
    Magic{0, "\xff\x4f\xff\x51"sv, &kJpeg2000},
    Magic{0, "\0\0\0\x0cJXL "sv, &kJpegXl},
    Magic{0, "\xff\x0a"sv, &kJpegXl},
    Magic{0, "\x1a\x45\xdf\xa3"sv, &kFilm},  // Matroska, WebM
    Magic{0, "\0\0\1\xba"sv, &kFilm},        // MPEG
    Magic{0, "\x30\x26\xb2\x75"sv, &kFilm},  // Windows Media
    Magic{0, "FLV\1"sv, &kFilm},
    Magic{0, "OggS"sv, &kFilm},
    Magic{0, "ID3"sv, &kSound},
    Magic{0, "%PDF"sv, &kPdf},
    Magic{0, "PK\3\4"sv, &kArchive},
    Magic{0, "\x1f\x8b"sv, &kArchive},
    Magic{0, "7z\xbc\xaf"sv, &kArchive},
    Magic{0, "Rar!"sv, &kArchive},
};

struct Ending {
  std::string_view ending;
  const FileKind* kind;
};

constexpr std::array kRawEndings{".dng"sv, ".nef"sv, ".nrw"sv, ".arw"sv, ".sr2"sv, ".srf"sv, ".cr2"sv, ".cr3"sv,
                                 ".crw"sv, ".pef"sv, ".orf"sv, ".rw2"sv, ".raf"sv, ".srw"sv, ".3fr"sv, ".fff"sv,
                                 ".iiq"sv, ".mrw"sv, ".x3f"sv, ".erf"sv, ".kdc"sv, ".dcr"sv, ".mos"sv, ".gpr"sv};
constexpr std::array kEndings{
    Ending{".heic", &kHeif},  Ending{".heif", &kHeif},     Ending{".hif", &kHeif},  Ending{".avif", &kAvif},
    Ending{".jxl", &kJpegXl}, Ending{".jp2", &kJpeg2000},  Ending{".webp", &kWebP}, Ending{".gif", &kGif},
    Ending{".bmp", &kBmp},    Ending{".psd", &kPhotoshop}, Ending{".exr", &kExr},   Ending{".hdr", &kRadiance},
    Ending{".mp4", &kFilm},   Ending{".mov", &kFilm},      Ending{".insv", &kFilm}, Ending{".360", &kFilm},
    Ending{".avi", &kFilm},   Ending{".mkv", &kFilm},      Ending{".mts", &kFilm},  Ending{".m2ts", &kFilm},
    Ending{".lrv", &kFilm},
};

std::string lower_ending(std::string_view name) {
  const std::size_t dot = name.rfind('.');
  if (dot == std::string_view::npos || name.find('/', dot) != std::string_view::npos) return {};
  std::string ending(name.substr(dot));
  std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return ending;
}

bool is_raw_name(std::string_view name) {
  return std::ranges::find(kRawEndings, lower_ending(name)) != kRawEndings.end();
}

/// Whether a TIFF is a camera's raw file: by DNG's tag, or because its first picture is a reduced copy or the sensor's
/// own numbers.
bool is_raw_tiff(std::span<const std::uint8_t> head) {
  constexpr std::uint32_t kSubfile = 254, kPhotometric = 262, kDngVersion = 50706;
  constexpr std::uint32_t kReduced = 1, kSensor = 32803, kLinearRaw = 34892;
  const TiffDirectory directory(head);
  const std::uint32_t light = directory.find(kPhotometric).value_or(0);
  return directory.find(kDngVersion) || (directory.find(kSubfile).value_or(0) & kReduced) != 0 || light == kSensor ||
         light == kLinearRaw;
}

/// The files of ISO's base format: by their brands.
const FileKind* boxed_kind(std::string_view text) {
  constexpr std::array kHeifBrands{"heic"sv, "heix"sv, "heim"sv, "heis"sv, "hevc"sv, "hevx"sv, "mif1"sv, "msf1"sv};
  const std::string_view brand = text.substr(8, 4);
  const std::string_view brands = text.substr(0, 64);
  if (brand == "crx ") return &kRaw;  // Canon
  if (brand == "jxl ") return &kJpegXl;
  if (brand == "avif" || brand == "avis" || (brand == "mif1" && brands.find("avif") != std::string_view::npos))
    return &kAvif;
  return std::ranges::find(kHeifBrands, brand) != kHeifBrands.end() ? &kHeif : &kFilm;
}

bool is_text(std::string_view text) {
  constexpr std::size_t kLooked = 1024;
  return std::ranges::all_of(text.substr(0, kLooked), [](unsigned char c) {
    return c >= 0x20 || c == '\n' || c == '\r' || c == '\t' || c == '\f';
  });
}

/// MPEG's transport stream: packets of 188 bytes, or of 192 with a time before each.
bool is_transport_stream(std::string_view text) {
  for (const auto& [first, step] : {std::pair<std::size_t, std::size_t>{0, 188}, {4, 192}}) {
    constexpr char kSync = 0x47;
    if (text.size() > first + 2 * step && text[first] == kSync && text[first + step] == kSync &&
        text[first + 2 * step] == kSync) {
      return true;
    }
  }
  return false;
}

}  // namespace

std::string text_of(const FileKind& kind) {
  return std::string(kind.one) + (kind.advice.empty() ? "" : ": ") + std::string(kind.advice);
}

bool begins_like_tiff(std::span<const std::uint8_t> head) {
  const std::string_view text(reinterpret_cast<const char*>(head.data()), head.size());
  return std::ranges::any_of(std::array{"II*\0"sv, "MM\0*"sv, "II+\0"sv, "MM\0+"sv},
                             [text](std::string_view start) { return text.starts_with(start); });
}

const FileKind* file_kind(std::span<const std::uint8_t> head, std::string_view name) {
  if (head.empty()) return &kEmpty;
  const std::string_view text(reinterpret_cast<const char*>(head.data()), head.size());
  if (text.starts_with("\xff\xd8\xff") || text.starts_with("\x89PNG\r\n\x1a\n")) return nullptr;
  for (const Magic& magic : kMagics) {
    if (text.size() > magic.at && text.substr(magic.at).starts_with(magic.bytes)) return magic.kind;
  }
  if (begins_like_tiff(head)) {
    const bool big = text[2] == '+' || text[3] == '+';  // whose directory has another form
    return is_raw_name(name) || (!big && is_raw_tiff(head)) ? &kRaw : nullptr;
  }
  if (text.size() >= 12 && text.substr(4, 4) == "ftyp") return boxed_kind(text);
  if (is_transport_stream(text)) return &kFilm;
  const std::string ending = lower_ending(name);
  const auto by_name = std::ranges::find(kEndings, ending, &Ending::ending);
  const bool described = by_name != kEndings.end();
  if (text.starts_with("BM") && text.size() > 2 && (ending == ".bmp" || !is_text(text))) return &kBmp;
  if (text.size() > 2 && text[0] == 'P' && text[1] >= '1' && text[1] <= '6' &&
      std::isspace(static_cast<unsigned char>(text[2])) != 0) {
    return &kNetpbm;
  }
  if (is_text(text)) return &kText;
  if (is_raw_name(name)) return &kRaw;
  return described ? by_name->kind : &kUnknown;
}

}  // namespace nodal::media
