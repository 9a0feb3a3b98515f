#version 450
// Colour, position and entity of a pixel in one pass: lamps from afar and light from everywhere,
// no shadows. What a picture costs without a GPU is the work of each pixel.

layout(constant_id = 0) const int NUM_DIRECTIONAL_LIGHTS = 0;

layout(set = 0, binding = 0) uniform CameraBuffer {
  mat4 viewMatrix;
  mat4 projectionMatrix;
  mat4 viewMatrixInverse;
  mat4 projectionMatrixInverse;
  float width;
  float height;
} cameraBuffer;

layout(set = 1, binding = 0) uniform ObjectTransformBuffer {
  mat4 modelMatrix;
} objectTransformBuffer;

layout(set = 1, binding = 1) uniform ObjectDataBuffer {
  uvec4 segmentation;
  float transparency;
  int shadeFlat;
} objectDataBuffer;

layout(set = 2, binding = 0) uniform MaterialBuffer {
  vec4 emission;
  vec4 baseColor;
  float fresnel;
  float roughness;
  float metallic;
  float transmission;
  float ior;
  float transmissionRoughness;
  int textureMask;
  int padding1;
  vec4 textureTransforms[6];
} materialBuffer;

layout(set = 2, binding = 1) uniform sampler2D colorTexture;
layout(set = 2, binding = 2) uniform sampler2D roughnessTexture;
layout(set = 2, binding = 3) uniform sampler2D normalTexture;
layout(set = 2, binding = 4) uniform sampler2D metallicTexture;
layout(set = 2, binding = 5) uniform sampler2D emissionTexture;
layout(set = 2, binding = 6) uniform sampler2D transmissionTexture;

struct PointLight {
  vec4 position;
  vec4 emission;
};
struct DirectionalLight {
  vec4 direction;
  vec4 emission;
};
struct SpotLight {
  vec4 position;
  vec4 direction;
  vec4 emission;
};

layout(set = 3, binding = 0) uniform SceneBuffer {
  vec4 ambientLight;
  PointLight pointLights[10];
  DirectionalLight directionalLights[3];
  SpotLight spotLights[10];
  SpotLight texturedLights[1];
} sceneBuffer;

layout(location = 0) in vec3 positionWorld;
layout(location = 1) in vec3 normalWorld;
layout(location = 2) in vec2 texturePlace;

layout(location = 0) out vec4 outColor;
layout(location = 1) out ivec4 outPositionSegmentation;

const float PI = 3.14159265;

// Reflected share of a lamp's light off a rough surface: microfacets by the distribution of
// Trowbridge and Reitz, masked as by Schlick, with his Fresnel term.
vec3 reflected(float toLight, float toEye, float toHalf, float halfToEye, float rough, vec3 straight) {
  float a2 = rough * rough * rough * rough;
  float k = (rough + 1.0) * (rough + 1.0) / 8.0;
  float spread = toHalf * toHalf * (a2 - 1.0) + 1.0;
  float away = 1.0 - halfToEye;
  float away2 = away * away;
  vec3 fresnel = straight + (1.0 - straight) * (away2 * away2 * away);
  float masked = (toEye * (1.0 - k) + k) * (toLight * (1.0 - k) + k);
  return fresnel * (a2 / max(4.0 * PI * spread * spread * masked, 1e-6));
}

// color to the power 1 / 2.2, to a sixth of what a byte can tell apart: roots take a third of the
// time of a power.
vec3 displayed(vec3 color) {
  vec3 root2 = sqrt(color);
  vec3 root4 = sqrt(root2);
  vec3 root8 = sqrt(root4);
  return 0.92620088 * root2 + 0.14748242 * root4 - 0.02743259 * root8 - 0.04687036 * color;
}

void main() {
  vec4 base = materialBuffer.baseColor;
  if ((materialBuffer.textureMask & 1) != 0) {
    base = texture(colorTexture, texturePlace);
  }
  vec3 diffuse = base.rgb * ((1.0 - materialBuffer.metallic) / PI);
  vec3 straight = mix(vec3(0.08 * materialBuffer.fresnel), base.rgb, materialBuffer.metallic);
  vec3 normal = normalize(normalWorld);
  vec3 eye = normalize(cameraBuffer.viewMatrixInverse[3].xyz - positionWorld);
  float toEye = clamp(dot(normal, eye), 1e-6, 1.0);

  vec3 color = materialBuffer.emission.rgb + sceneBuffer.ambientLight.rgb * base.rgb;
  for (int i = 0; i < NUM_DIRECTIONAL_LIGHTS; ++i) {
    vec3 light = -normalize(sceneBuffer.directionalLights[i].direction.xyz);
    float toLight = dot(normal, light);
    if (toLight > 0.0) {
      // What lies between two unit directions has the length sqrt(2 + 2 cos).
      float lightToEye = dot(light, eye);
      float scale = inversesqrt(max(2.0 + 2.0 * lightToEye, 1e-6));
      float toHalf = clamp((toLight + dot(normal, eye)) * scale, 0.0, 1.0);
      float halfToEye = clamp((1.0 + lightToEye) * scale, 0.0, 1.0);
      vec3 share = diffuse + reflected(
          toLight, toEye, toHalf, halfToEye, materialBuffer.roughness, straight);
      color += sceneBuffer.directionalLights[i].emission.rgb * (toLight * share);
    }
  }
  outColor = vec4(displayed(clamp(color, 0.0, 1.0)), 1.0);
  // Of the position only z, the camera looking along -z: whole millimetres, to the nearest.
  int z = int(round(-1000.0 / gl_FragCoord.w));
  outPositionSegmentation = ivec4(0, 0, z, int(objectDataBuffer.segmentation[1]));
}
