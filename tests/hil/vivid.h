// The kernel's virtual video driver, for tests in the guest.
#pragma once

#include <cstdint>
#include <string>

#include "hal/clock.h"
#include "hal/head.h"
#include "hal/linux/clock.h"
#include "hal/linux/v4l2/enumerator.h"

namespace nodal::hil {

// Controls of vivid, from its vivid-ctrls.c: buttons and settings that cause faults.
inline constexpr std::uint32_t kTimestampSource = 0x00f0f000 + 24;  ///< 1: start of exposure
inline constexpr std::uint32_t kWrapSequence = 0x00f0f000 + 38;
inline constexpr std::uint32_t kSignalMode = 0x00f0f000 + 60;  ///< 0 a signal, 1 none, 2 no lock
inline constexpr std::uint32_t kPercentDropped = 0x00f0f000 + 64;
inline constexpr std::uint32_t kDisconnect = 0x00f0f000 + 65;
inline constexpr std::uint32_t kBufferErrorFlag = 0x00f0f000 + 66;
inline constexpr std::uint32_t kReqbufsError = 0x00f0f000 + 67;
inline constexpr std::uint32_t kQbufError = 0x00f0f000 + 68;
inline constexpr std::uint32_t kStreamonError = 0x00f0f000 + 69;
inline constexpr std::uint32_t kFatalError = 0x00f0f000 + 70;

/// "v4l2:platform:vivid-003" is device 3; the kernel's command line sets the number and the inputs of the devices.
std::string vivid_path(int device);

/// Heads cam0, cam1, … of rig.toml: NTSC on these devices. Those with odd numbers deliver each field by itself.
std::string ntsc_heads_toml(int heads);

/// Sets a control of a device through a separate descriptor; value 1 presses a button. Throws on failure.
void set_vivid(int device, std::uint32_t control, int value);

/// An S-Video input with NTSC.
hal::v4l2::HeadRequest ntsc(PixelFormat pixels);
/// A progressive webcam with 30 frames per second and gain steps of 0.1 dB.
hal::v4l2::HeadRequest webcam(PixelFormat pixels);

/// A head's next frame, still lent, or its error; kTimeout after 2 s.
Result<hal::FrameView> next_frame(hal::HeadPort& head, hal::ClockPort& clock);

/// Waits; in the guest's virtual time if it was booted with it.
void wait_for(Duration time);

}  // namespace nodal::hil
