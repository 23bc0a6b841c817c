// Matroska files: read by a reader written here from RFC 8794 and 9559, and by FFmpeg.
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "protocol/take/matroska_writer.h"
#include "tests/support/matroska_elements.h"
#include "tests/support/pictures.h"
#include "tests/support/process.h"

namespace nodal::take {
namespace {

using Bytes = std::vector<std::uint8_t>;

using test::child;
using test::children;
using test::Element;
using test::element_at;
using test::value_of;

struct Frame {
  std::uint64_t us = 0;
  Bytes bytes;
  friend bool operator==(const Frame&, const Frame&) = default;
};

constexpr std::uint64_t kSegment = 0x18538067, kCluster = 0x1F43B675;

Element segment_of(const Bytes& file) {
  const Element ebml = element_at(file, 0, file.size()).value();
  EXPECT_EQ(ebml.id, 0x1A45DFA3U);
  const Element segment = element_at(file, ebml.content + ebml.size, file.size()).value();
  EXPECT_EQ(segment.id, kSegment);
  return segment;
}

/// The frames of all complete clusters, each checked by its CRC.
std::vector<Frame> frames_of(const Bytes& file) {
  std::vector<Frame> frames;
  for (const Element& cluster : children(file, segment_of(file))) {
    if (cluster.id != kCluster) continue;
    const std::vector<Element> parts = children(file, cluster);
    EXPECT_EQ(parts.at(0).id, 0xBFU) << "the CRC is the first";
    const std::uint64_t checked = parts[0].content + 4;
    const auto crc = static_cast<std::uint32_t>(
        crc32_z(0, file.data() + checked, static_cast<std::size_t>(cluster.content + cluster.size - checked)));
    for (int k = 0; k < 4; ++k)
      EXPECT_EQ(file[parts[0].content + static_cast<std::uint64_t>(k)], crc >> (8 * k) & 0xFF);
    EXPECT_EQ(parts.at(1).id, 0xE7U);
    const std::uint64_t begin = value_of(file, parts[1]);
    for (std::size_t k = 2; k < parts.size(); ++k) {
      EXPECT_EQ(parts[k].id, 0xA3U);
      const std::uint8_t* const block = file.data() + parts[k].content;
      EXPECT_EQ(block[0], 0x81) << "track 1";
      EXPECT_EQ(block[3], 0x80) << "a key frame";
      const auto after = static_cast<std::int16_t>(block[1] << 8 | block[2]);
      EXPECT_GE(after, 0);
      frames.push_back({(begin + static_cast<std::uint64_t>(after)) * 10, {block + 4, block + parts[k].size}});
    }
  }
  return frames;
}

VideoTrack track(int width, int height) {
  VideoTrack track;
  track.width = width;
  track.height = height;
  track.rate = FrameRate{30, 1};
  track.equirectangular = true;
  track.writer = "a test";
  return track;
}

void append(Bytes& file, const Bytes& more) { file.insert(file.end(), more.begin(), more.end()); }

struct Film {
  Bytes file;
  std::vector<Frame> frames;
};

/// In pieces of several sizes.
bool are_whole_clusters(std::span<const std::uint8_t> bytes) {
  std::size_t whole = 0;
  for (const std::size_t piece : {std::size_t{1}, std::size_t{7}, bytes.size()}) {
    ClusterCheck check;
    for (std::size_t at = 0; at < bytes.size(); at += piece)
      check.add(bytes.subspan(at, std::min(piece, bytes.size() - at)));
    whole += check.whole() ? 1 : 0;
  }
  EXPECT_TRUE(whole == 0 || whole == 3);
  return whole == 3;
}

/// Without the index and the sector of the end.
Bytes torn_film(MatroskaWriter& writer, const std::vector<Frame>& frames) {
  Bytes file = writer.head();
  std::vector<Block> blocks;
  std::size_t bytes = 0;
  const auto write = [&] {
    if (blocks.empty()) return;
    const MatroskaWriter::Cluster cluster = writer.cluster(blocks);
    Bytes whole;
    for (const auto& piece : cluster.pieces) whole.insert(whole.end(), piece.begin(), piece.end());
    EXPECT_TRUE(are_whole_clusters(whole));
    append(file, whole);
    for (std::size_t k = 0; k < blocks.size(); ++k) {
      const auto at = file.begin() + static_cast<std::ptrdiff_t>(cluster.frames_at[k]);
      EXPECT_TRUE(std::ranges::equal(blocks[k].frame, std::span(at, blocks[k].frame.size())));
    }
    EXPECT_EQ(file.size(), writer.size());
    blocks.clear();
    bytes = 0;
  };
  for (const Frame& each : frames) {
    const Block block{Duration::microseconds(static_cast<std::int64_t>(each.us)), each.bytes};
    if (!blocks.empty() && MatroskaWriter::cluster_full(bytes, blocks.front().since_start, block)) write();
    blocks.push_back(block);
    bytes += each.bytes.size();
  }
  write();
  return file;
}

Film film(const VideoTrack& track, const std::vector<Frame>& frames) {
  MatroskaWriter writer(track);
  Film film{torn_film(writer, frames), frames};
  append(film.file, writer.end());
  std::ranges::copy(writer.sector(), film.file.begin() + MatroskaWriter::kSectorAt);
  return film;
}

std::vector<Frame> numbered(int count, std::size_t size, std::uint64_t period_us = 33'330) {
  std::vector<Frame> frames;
  for (int i = 0; i < count; ++i) {
    frames.push_back({static_cast<std::uint64_t>(i) * period_us, Bytes(size + static_cast<std::size_t>(i % 7))});
    for (std::size_t k = 0; k < frames.back().bytes.size(); ++k) {
      frames.back().bytes[k] = static_cast<std::uint8_t>(static_cast<std::size_t>(i) * 31 + k);
    }
  }
  return frames;
}

TEST(Matroska, FramesOfEverySizeAndTime_AreReadAsTheyWereWritten) {
  for (const std::size_t size : {0U, 1U, 120U, 122U, 123U, 126U, 16'375U, 16'379U, 16'380U, 2'097'145U, 2'097'150U}) {
    const Film made = film(track(64, 32), numbered(9, size));
    EXPECT_EQ(frames_of(made.file), made.frames) << size;
  }
  const std::vector<Frame> far{{0, {1}}, {0, {2}}, {9'223'372'036'854'770, {3}}, {9'223'372'036'854'770, {4}}};
  EXPECT_EQ(frames_of(film(track(64, 32), far).file), far) << "292 years, the last times that fit";
}

TEST(Matroska, Clusters_HaveAQuarterSecondOrFourMebibytesAtMost) {
  const auto clusters = [](const Film& made) {
    std::vector<std::pair<std::uint64_t, std::size_t>> all;  // size, blocks
    for (const Element& each : children(made.file, segment_of(made.file))) {
      if (each.id == kCluster) all.emplace_back(each.size, children(made.file, each).size() - 2);
    }
    return all;
  };
  const auto by_time = clusters(film(track(64, 32), numbered(64, 1000)));
  ASSERT_EQ(by_time.size(), 8U);  // 33.33 ms a frame: the ninth begins 266 ms after the first
  for (const auto& [size, blocks] : by_time) EXPECT_EQ(blocks, 8U);
  for (const auto& [size, blocks] : clusters(film(track(64, 32), numbered(9, 1'500'000)))) {
    EXPECT_LE(size, MatroskaWriter::kLargestCluster + 64);
    EXPECT_LE(blocks, 2U);
  }
  EXPECT_EQ(clusters(film(track(64, 32), numbered(3, 5'000'000))).size(), 3U) << "a large frame has its own";
}

TEST(Matroska, CutAnywhere_EveryCompleteClusterIsRead) {
  const Film made = film(track(64, 32), numbered(20, 40));
  const std::vector<Frame> all = frames_of(made.file);
  ASSERT_EQ(all.size(), 20U);
  std::size_t before = 0;
  for (std::size_t cut = 1024 + 200; cut <= made.file.size(); ++cut) {
    const std::vector<Frame> some =
        frames_of({made.file.begin(), made.file.begin() + static_cast<std::ptrdiff_t>(cut)});
    EXPECT_TRUE(std::equal(some.begin(), some.end(), all.begin())) << cut;
    EXPECT_GE(some.size(), before);
    before = some.size();
  }
  EXPECT_EQ(before, 20U);
}

TEST(Matroska, IndexAndSeekHead_PointAtWhatTheyName) {
  const Film made = film(track(64, 32), numbered(50, 300));
  const Element segment = segment_of(made.file);
  const Element seek_head = child(made.file, segment, 0x114D9B74).value();
  EXPECT_EQ(seek_head.at, MatroskaWriter::kSectorAt);
  int seeks = 0;
  for (const Element& seek : children(made.file, seek_head)) {
    const std::uint64_t id = value_of(made.file, child(made.file, seek, 0x53AB).value());
    const std::uint64_t at = segment.content + value_of(made.file, child(made.file, seek, 0x53AC).value());
    EXPECT_EQ(element_at(made.file, at, made.file.size())->id, id);
    ++seeks;
  }
  EXPECT_EQ(seeks, 2);
  std::size_t cues = 0, clusters = 0;
  for (const Element& point : children(made.file, child(made.file, segment, 0x1C53BB6B).value())) {
    const Element where = child(made.file, point, 0xB7).value();
    const std::uint64_t at = segment.content + value_of(made.file, child(made.file, where, 0xF1).value());
    const Element cluster = element_at(made.file, at, made.file.size()).value();
    EXPECT_EQ(cluster.id, kCluster);
    EXPECT_EQ(value_of(made.file, child(made.file, cluster, 0xE7).value()),
              value_of(made.file, child(made.file, point, 0xB3).value()));
    ++cues;
  }
  for (const Element& each : children(made.file, segment)) clusters += each.id == kCluster ? 1 : 0;
  EXPECT_EQ(cues, clusters);
}

TEST(Matroska, AChangedByteOrLength_IsNoWholeCluster) {
  const Film made = film(track(64, 32), numbered(3, 20));
  const Element cluster = child(made.file, segment_of(made.file), kCluster).value();
  const Bytes whole(made.file.begin() + static_cast<std::ptrdiff_t>(cluster.at),
                    made.file.begin() + static_cast<std::ptrdiff_t>(cluster.content + cluster.size));
  ASSERT_TRUE(are_whole_clusters(whole));
  for (std::size_t k = 0; k < whole.size(); ++k) {
    Bytes changed = whole;
    changed[k] ^= 4;
    EXPECT_FALSE(are_whole_clusters(changed)) << k;
    EXPECT_EQ(are_whole_clusters(std::span(whole).first(k)), k == 0) << k;
  }
}

TEST(Matroska, AFileThatIsContinued_IsFinishedAsOneThatWasNot) {
  const std::vector<Frame> frames = numbered(30, 300);
  const Film made = film(track(64, 32), frames);
  MatroskaWriter writer(track(64, 32)), later(track(64, 32));
  Bytes file = torn_film(writer, frames);
  for (const Element& each : children(file, segment_of(file))) {
    if (each.id != kCluster) continue;
    const std::uint64_t begin = value_of(file, child(file, each, 0xE7).value()) * 10;
    const std::size_t blocks = children(file, each).size() - 2;
    const Duration first = Duration::microseconds(static_cast<std::int64_t>(begin));
    const Duration newest = first + Duration::microseconds(33'330) * static_cast<std::int64_t>(blocks - 1);
    later.note_cluster(first, newest, each.content + each.size);
  }
  append(file, later.end());
  std::ranges::copy(later.sector(), file.begin() + MatroskaWriter::kSectorAt);
  EXPECT_EQ(file, made.file);
}

TEST(Matroska, WithoutAFrame_IsAFileToo) { EXPECT_TRUE(frames_of(film(track(64, 32), {}).file).empty()); }

/// FFmpeg's answer, or nothing where it is not installed.
/// `attached`: FFmpeg says that it has no codec for attachments.
std::optional<std::string> answer(const std::vector<std::string>& command, bool attached = false) {
  if (test::Process({"sh", "-c", "command -v " + command[0]}).wait().code != 0) return std::nullopt;
  const test::Finished run = test::Process(command).wait();
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_TRUE(attached || run.err.empty()) << run.err;
  return run.out;
}

TEST(Matroska, FfmpegReadsSizeTimesAndProjection_AndDecodesWhatWasWritten) {
  const test::TemporaryFolder folder;
  std::vector<Frame> frames;
  for (int i = 0; i < 12; ++i) {
    const auto jpeg = test::jpeg_of(test::smooth_rgb(64, 32, i), 64, 32, test::Sampling::k420);
    frames.push_back({static_cast<std::uint64_t>(i) * 40'000, {jpeg.begin(), jpeg.end()}});
    test::write_bytes(folder / ("f" + std::to_string(100 + i) + ".jpg"), frames.back().bytes);
  }
  VideoTrack of = track(64, 32);
  of.rate = FrameRate{25, 1};
  const Film made = film(of, frames);
  test::write_bytes(folder / "film.mkv", made.file);
  const std::string file = (folder / "film.mkv").string();
  const auto said = answer({"ffprobe", "-v", "warning", "-show_streams", "-show_format", "-show_packets", file});
  if (!said) GTEST_SKIP() << "ffprobe is not installed";
  for (const char* words : {"codec_name=mjpeg", "width=64", "height=32", "projection=equirectangular",
                            "duration=0.480000", "r_frame_rate=25/1", "color_range=pc"}) {
    EXPECT_NE(said->find(words), std::string::npos) << words << "\n" << *said;
  }
  for (int i = 0; i < 12; ++i) {
    char time[32];
    std::snprintf(time, sizeof time, "pts_time=%d.%06d", i * 40 / 1000, i * 40'000 % 1'000'000);
    EXPECT_NE(said->find(time), std::string::npos) << time;
  }
  const auto by_film = answer({"ffmpeg", "-v", "warning", "-i", file, "-f", "md5", "-"});
  const auto by_files = answer({"ffmpeg", "-v", "warning", "-framerate", "25", "-pattern_type", "glob", "-i",
                                (folder / "f*.jpg").string(), "-f", "md5", "-"});
  EXPECT_EQ(by_film, by_files);
  // Cut after the first cluster, with the sector as it was at first: without duration and index.
  MatroskaWriter writer(of);
  const Bytes torn = torn_film(writer, {frames.begin(), frames.begin() + 7});
  test::write_bytes(folder / "torn.mkv", torn);
  const auto rest = answer({"ffprobe", "-v", "error", "-count_packets", "-show_entries", "stream=nb_read_packets",
                            "-of", "default=nk=1:nw=1", (folder / "torn.mkv").string()});
  EXPECT_EQ(rest, "7\n") << "the first cluster: seven frames in a quarter second";
}

TEST(Matroska, FfmpegDecodesRawPicturesOfEveryFormat_ToTheBytesThatWereWritten) {
  struct Case {
    PixelFormat format;
    const char* ffmpeg;
  };
  const test::TemporaryFolder folder;
  for (const Case& each :
       {Case{PixelFormat::kGrey8, "gray"}, Case{PixelFormat::kI420, "yuv420p"}, Case{PixelFormat::kNv12, "nv12"},
        Case{PixelFormat::kYuyv, "yuyv422"}, Case{PixelFormat::kUyvy, "uyvy422"}, Case{PixelFormat::kI422, "yuv422p"},
        Case{PixelFormat::kRgb24, "rgb24"}, Case{PixelFormat::kRggb8, "bayer_rggb8"},
        Case{PixelFormat::kGrbg8, "bayer_grbg8"}, Case{PixelFormat::kGbrg8, "bayer_gbrg8"},
        Case{PixelFormat::kBggr8, "bayer_bggr8"}, Case{PixelFormat::kYuv411, "uyyvyy411"}}) {
    VideoTrack of = track(36, 22);
    of.codec = "V_UNCOMPRESSED";
    of.fourcc = fourcc_of(each.format);
    of.fields = Fields::kBottomFirst;
    of.coding = {.video_range = true, .bt709 = true};
    of.attachments = {{"calibration.json", "application/json", "{\"heads\": []}"}};
    std::vector<Frame> frames = numbered(5, packed_size(each.format, 36, 22));
    Bytes all;
    for (Frame& frame : frames) {
      frame.bytes.resize(packed_size(each.format, 36, 22));
      append(all, frame.bytes);
    }
    test::write_bytes(folder / "raw.mkv", film(of, frames).file);
    const std::string file = (folder / "raw.mkv").string();
    const auto said = answer({"ffprobe", "-v", "warning", "-show_streams", file}, true);
    if (!said) GTEST_SKIP() << "ffprobe is not installed";
    for (const std::string& words : {std::string("codec_name=rawvideo"), std::string("pix_fmt=") + each.ffmpeg + "\n",
                                     std::string("color_range=tv"), std::string("color_space=bt709"),
                                     std::string("field_order=bt"), std::string("TAG:filename=calibration.json")}) {
      EXPECT_NE(said->find(words), std::string::npos) << words << "\n" << *said;
    }
    EXPECT_TRUE(answer({"ffmpeg", "-v", "error", "-y", "-i", file, "-map", "0:v", "-c", "copy", "-f", "rawvideo",
                        (folder / "raw").string()},
                       true));
    EXPECT_EQ(test::read_bytes(folder / "raw"), all) << each.ffmpeg;
  }
}

}  // namespace
}  // namespace nodal::take
