// What ops may read besides the shading point: the images of the scene, and the scene itself for attributes.
#pragma once

namespace gi {

class Scene;
class ImageSet;

struct ShaderResources {
  const ImageSet* images = nullptr;
  const Scene* scene = nullptr;  // set by Scene
};

}  // namespace gi
