// Errors that a user can act on. Thrown only where data enters the native side; inside there are assertions.
#pragma once
#include <stdexcept>
#include <string>

namespace gi {

// Bad input: names the array and the Blender object, material or node. Python sees ValueError.
struct InputError : std::runtime_error {
  using std::runtime_error::runtime_error;
};
// A library or the machine failed us (Embree, memory). Python sees RuntimeError.
struct DeviceError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

inline void require(bool ok, const std::string& message) {
  if (!ok) throw InputError(message);
}

}  // namespace gi
