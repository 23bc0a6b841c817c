// A film for takes: every picture holds the number of its set and of its head. check() reads a take by the positions in
// its evidence.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "firmware/record/take_writer.h"
#include "hal/disk.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"

namespace nodal::firmware::take_film {

using Bytes = std::vector<std::uint8_t>;

inline constexpr int kTakeWidth = 24, kTakeHeight = 10, kTakeHeads = 3, kSetsARow = 4, kRowsASync = 2;
inline constexpr Duration kTakePeriod = Duration::milliseconds(33);

/// Grey pictures, and for head 2 bytes that count as JPEGs of different lengths.
inline Bytes picture(std::uint64_t set, std::size_t head) {
  Bytes bytes(head == 2 ? 100 + set % 50 : kTakeWidth * kTakeHeight, static_cast<std::uint8_t>(set * 7 + head));
  for (std::size_t k = 0; k < 8; ++k) bytes[k] = static_cast<std::uint8_t>(set >> (8 * k));
  bytes[8] = static_cast<std::uint8_t>(head);
  return bytes;
}

/// Rows and the pictures that they refer to.
struct Film {
  std::vector<TakeRow> rows;
  std::vector<std::unique_ptr<Bytes>> pictures;
};

inline Film film(int rows, int first_height = kTakeHeight, int sets_a_row = kSetsARow, Duration period = kTakePeriod) {
  Film film;
  std::uint64_t set = 100;
  for (int r = 0; r < rows; ++r) {
    TakeRow& row = film.rows.emplace_back();
    row.rate = FrameRate::make(1'000, static_cast<std::uint64_t>(period.ms())).value();
    for (std::size_t head = 0; head < kTakeHeads; ++head) {
      const PixelFormat format = head == 2 ? PixelFormat::kMjpeg : PixelFormat::kGrey8;
      row.streams[head] = take::Stream{format, kTakeWidth, first_height, {}, Fields::kProgressive};
    }
    for (int k = 0; k < sets_a_row; ++k, ++set) {
      RecordedSet& to = row.sets.emplace_back();
      to.number = set;
      to.mid_exposure = Instant::from_ns(5'000'000'000) + period * static_cast<std::int64_t>(set);
      for (std::size_t head = 0; head < kTakeHeads; ++head) {
        if (set % 11 == 3 && head == 1) continue;  // it has no picture here
        film.pictures.push_back(std::make_unique<Bytes>(picture(set, head)));
        to.frames[head].bytes = *film.pictures.back();
        to.frames[head].placeholder = Placeholder::kNone;
      }
    }
    film.pictures.push_back(std::make_unique<Bytes>(Bytes(300, static_cast<std::uint8_t>(r))));
    row.raymaps.push_back({row.sets.front().number, row.sets.front().mid_exposure, *film.pictures.back()});
  }
  return film;
}

inline TakeWriter::Documents documents() {
  TakeWriter::Documents documents;
  documents.about.number = 42;
  documents.about.rig = "test";
  documents.about.software = "a test";
  documents.about.rate = {30, 1};
  documents.about.mode = "driver";
  documents.about.layout = "equirectangular";
  documents.about.heads = {"a", "b", "c"};
  documents.calibration_json = "{}";
  documents.rig_toml = "[rig]";
  documents.raymap_width = 64;
  documents.raymap_height = 32;
  return documents;
}

/// Writes the film until the disk fails. Returns how many sets were durable by then.
inline std::uint64_t record(hal::DiskPort& disk, const Film& film, bool end, Status* failed = nullptr) {
  auto writer = TakeWriter::begin(disk, documents());
  if (!writer) return 0;
  std::uint64_t durable = 0;
  Status good;
  for (std::size_t r = 0; r < film.rows.size() && good; ++r) {
    good = (*writer)->write(film.rows[r]);
    if (!good || r % kRowsASync != kRowsASync - 1) continue;
    good = (*writer)->sync(Instant(), 0);
    if (good) durable = (*writer)->sets();
  }
  if (failed) *failed = good;
  if (good && end && (*writer)->end("stopped")) durable = (*writer)->sets();
  return durable;
}

inline Bytes read(hal::DiskPort& disk, const std::string& name) {
  return disk.read("000042/" + name, 1 << 24).value_or(Bytes());
}

/// Checks all of a take: manifest, hashes, evidence, every picture of every head. Returns the number of its sets.
inline std::uint64_t check(hal::DiskPort& disk, const take::Manifest& manifest) {
  std::uint64_t sets = 0, deleted = 0;
  for (const take::Manifest::File& file : manifest.files) {
    const Bytes bytes = read(disk, file.name);
    EXPECT_EQ(bytes.size(), file.bytes) << file.name;
    take::PieceHashes hashes;
    hashes.update(bytes);
    EXPECT_EQ(take::digest_of(hashes.all()), file.digest) << file.name;
    if (!file.name.starts_with("evidence")) continue;
    const auto segment = take::read_evidence(bytes, file.name);
    EXPECT_TRUE(segment) << segment.error().text();
    if (!segment) continue;
    EXPECT_TRUE(segment->end.has_value());
    EXPECT_EQ(segment->good_bytes, bytes.size());
    EXPECT_GE(segment->begin.first_set(), sets + deleted);
    deleted = segment->begin.first_set() - sets;
    EXPECT_LE(deleted, manifest.deleted_sets);
    sets += segment->sets.size();
    for (int k = 0; k < segment->begin.files_size(); ++k) {
      const take::wire::File& of = segment->begin.files(k);
      const Bytes video = read(disk, of.name());
      EXPECT_EQ(video.size(), segment->end->length(k));
      if (video.size() != segment->end->length(k)) continue;
      for (const take::wire::Set& set : segment->sets) {
        if (!of.has_head()) break;
        const take::wire::Frame& frame = set.frames(k);
        EXPECT_EQ(frame.file(), static_cast<std::uint32_t>(k));
        EXPECT_EQ(frame.placeholder(), set.number() % 11 == 3 && of.head() == 1 ? "missing" : "");
        if (!frame.placeholder().empty()) continue;
        const auto at = video.begin() + static_cast<std::ptrdiff_t>(frame.at());
        EXPECT_EQ(Bytes(at, at + static_cast<std::ptrdiff_t>(frame.bytes())), picture(set.number(), of.head()))
            << of.name() << " set " << set.number();
      }
    }
  }
  EXPECT_EQ(manifest.sets, sets);
  return sets;
}

}  // namespace nodal::firmware::take_film
