// The extension module gi_engine_native._core.
#include "bind/bind.h"

#include "core/check.h"

namespace nb = nanobind;

NB_MODULE(_core, m) {
  nb::register_exception_translator([](const std::exception_ptr& p, void*) {
    try {
      std::rethrow_exception(p);
    } catch (const gi::InputError& e) {
      PyErr_SetString(PyExc_ValueError, e.what());
    } catch (const gi::DeviceError& e) {
      PyErr_SetString(PyExc_RuntimeError, e.what());
    }
  });
  gi::bind::bind_render(m);
  gi::bind::bind_shading(m);
  gi::bind::bind_lobes(m);
  gi::bind::bind_images(m);
  gi::bind::bind_evaluate(m);
  gi::bind::bind_bsdf(m);
  gi::bind::bind_lights(m);
  gi::bind::bind_guide(m);
  gi::bind::bind_points(m);
  gi::bind::bind_scattering(m);
  gi::bind::bind_connections(m);
  gi::bind::bind_hash(m);
  gi::bind::bind_irradiance(m);
}
