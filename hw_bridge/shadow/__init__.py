"""Model-based monitoring: a simulated drive in parallel to the real one, whose residuals indicate a faulty part."""

from hw_bridge.shadow.shadow import Shadow as Shadow
from hw_bridge.shadow.shadow import shadows as shadows
from hw_bridge.shadow.symptoms import SYMPTOMS as SYMPTOMS
