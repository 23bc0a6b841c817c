// The registers of an emulated IIDC camera.
#pragma once

#include <cstdint>
#include <map>

namespace nodal::test {

/// A camera of version 1.31 with 640x480 (grey, YUV 4:2:2, YUV 4:1:1), format 7 up to 96x64, shutter, gain, white
/// balance and frame rate, of which all but the white balance have absolute values, triggers 0 and 1, and Point Grey's
/// embedded numbers. It comes like many cameras: still transmitting, everything automatic, absolute values off.
///
/// It shares no code with the driver: offsets and bits are written down again, from the specification (IIDC 1.31).
///
/// Threading: one thread at a time.
class IidcRegisters {
 public:
  static constexpr std::uint64_t kBase = 0xF0'0000;          ///< address of the command registers
  static constexpr std::uint64_t kAbsolute = kBase + 0x900;  ///< address of the absolute values, 16 bytes a feature
  static constexpr std::uint64_t kFormat7 = kBase + 0xA00;
  static constexpr unsigned kShutter = 7, kGain = 8, kWhiteBalance = 3, kFrameRate = 15, kAutoExposure = 1;
  static constexpr float kShutterLow = 0.0001F, kShutterHigh = 0.0301F;  ///< seconds
  static constexpr float kGainHigh = 24;                                 ///< decibels

  IidcRegisters();

  /// From FFFF F000 0000h. False: the camera refuses.
  bool read(std::uint64_t offset, std::uint32_t& value) const;
  bool write(std::uint64_t offset, std::uint32_t value);

  /// A command register.
  std::uint32_t get(std::uint32_t offset) const { return values_.at(kBase + offset); }
  void set(std::uint32_t offset, std::uint32_t value) { values_[kBase + offset] = value; }
  void remove(std::uint32_t offset) { values_.erase(kBase + offset); }
  /// After every setting: 0x0080'0000 a bad size or place, 0x0040'0000 a bad packet.
  void refuse_format7(std::uint32_t errors) { format7_errors_ = errors; }
  void set_format7(std::uint32_t offset, std::uint32_t value) { values_[kFormat7 + offset] = value; }
  float absolute(unsigned feature) const;
  void set_absolute_high(unsigned feature, float value);

  bool transmits() const { return (get(0x614) & 0x8000'0000) != 0; }
  bool triggered() const { return (get(0x830) & 0x0200'0000) != 0; }
  /// Gain, shutter and counter, nothing else.
  bool embeds() const { return values_.contains(kBase + 0x12F8) && (get(0x12F8) & 0x3FF) == 0x46; }
  std::uint32_t width() const;
  std::uint32_t height() const;
  std::uint32_t picture_bytes() const;
  double hertz() const;

 private:
  void write_feature(unsigned feature, std::uint32_t value);
  void write_absolute(unsigned feature, float value);
  void write_format7(std::uint32_t offset, std::uint32_t value);
  bool scalable() const { return get(0x608) >> 29 == 7; }
  std::uint32_t format7(std::uint32_t offset) const { return values_.at(kFormat7 + offset); }

  std::uint32_t format7_errors_ = 0;
  std::map<std::uint64_t, std::uint32_t> values_;
};

}  // namespace nodal::test
